"""`holdfast label`: one file for each mode."""

from holdfast.cli.label.verb import label

__all__ = ["label"]
