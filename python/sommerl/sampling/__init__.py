"""Importance samplers: each draws a direction to the light for a direction to the viewer, and gives its density."""
