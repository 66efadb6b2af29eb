"""The verb `holdfast info`, and its tables."""

from holdfast.cli.info.verb import info

__all__ = ["info"]
