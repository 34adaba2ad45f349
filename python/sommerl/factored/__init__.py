"""Factored BRDFs: Lawrence, Rusinkiewicz & Ramamoorthi 2004, the paper's main rival."""
