"""Formats of other programs for holdfast: LeRobot, Foxglove, Label Studio, public data sets."""
