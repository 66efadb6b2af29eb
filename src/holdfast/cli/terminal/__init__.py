"""Output to the terminal, and keys and signals from it."""
