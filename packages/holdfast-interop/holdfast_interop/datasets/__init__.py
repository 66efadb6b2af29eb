"""Public recordings: what they hold, and how they are downloaded."""

from holdfast_interop.datasets.registry import PublicFile, PublicSet, find_set, public_sets

__all__ = ["PublicFile", "PublicSet", "find_set", "public_sets"]
