"""What a BRDF is, and its forms on cells and nodes."""
