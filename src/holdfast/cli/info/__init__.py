"""The verb `holdfast info`, and its tables."""
