"""The verb `holdfast label`; one file for each of its modes."""

from holdfast.cli.label.verb import label

__all__ = ["label"]
