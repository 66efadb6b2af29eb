"""Figures of the study and of the trials, with matplotlib."""
