"""The verb `holdfast train`, and its options."""

from holdfast.cli.train.verb import train

__all__ = ["train"]
