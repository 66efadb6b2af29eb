"""Public recordings."""
