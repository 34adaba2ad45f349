"""The preset `compact`: fits nodes to a material, makes a palette for them, and searches for a size or a quality."""
