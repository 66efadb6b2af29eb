"""The verb `holdfast detect`, and what it prints."""

from holdfast.cli.detect.verb import detect

__all__ = ["detect"]
