"""What carries the rest, and knows nothing of reflectance: errors, files, signals, threads."""
