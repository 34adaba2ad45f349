"""Materials as source code: C++, GLSL, HLSL, WGSL, MSL."""
