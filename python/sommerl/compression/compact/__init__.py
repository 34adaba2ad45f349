"""The preset compact: nodes fitted to a material, a palette for them, and a search for the size."""
