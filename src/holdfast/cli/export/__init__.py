"""The verb `holdfast export`: models and recordings."""

from holdfast.cli.export.verb import export

__all__ = ["export"]
