"""Formats of other programs for holdfast: LeRobot, Rerun, public data sets."""
