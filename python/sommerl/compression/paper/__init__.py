"""The paper's method on MERL's cells."""
