"""Hands of other rooms."""
