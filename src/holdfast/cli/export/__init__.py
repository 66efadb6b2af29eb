"""The verb `holdfast export`: models and recordings."""
