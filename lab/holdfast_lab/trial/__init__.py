"""Trials of grip laws against each other on the twin."""
