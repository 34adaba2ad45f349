"""Factored BRDFs (Lawrence, Rusinkiewicz & Ramamoorthi 2004), which the paper compares its method with."""
