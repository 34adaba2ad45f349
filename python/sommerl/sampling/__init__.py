"""Importance samplers: they draw directions to the light for a direction to the viewer, and give their density."""
