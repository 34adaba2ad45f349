"""Reproduces the paper's tables and figures (Kurt & Cinsdikici 2008) from any data."""
