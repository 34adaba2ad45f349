"""Analytic BRDF models, and the built-in materials."""
