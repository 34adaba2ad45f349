"""What every other room uses and what has nothing to do with reflectance: errors, files, signals, threads."""
