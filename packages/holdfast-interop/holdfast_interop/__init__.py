"""Formats of other programs for holdfast: LeRobot, Rerun, Label Studio, public data sets."""
