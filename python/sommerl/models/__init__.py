"""BRDFs by formula, and the built-in ones."""
