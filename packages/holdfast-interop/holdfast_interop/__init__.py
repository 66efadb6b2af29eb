"""Formats of other programs for holdfast: LeRobot, Foxglove, public data sets."""
