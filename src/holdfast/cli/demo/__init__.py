"""The verb `holdfast demo`, and how it replays recordings."""

from holdfast.cli.demo.verb import demo

__all__ = ["demo"]
