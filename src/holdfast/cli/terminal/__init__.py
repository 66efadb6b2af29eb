"""The terminal: printing, progress, keys and signals."""
