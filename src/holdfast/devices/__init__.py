"""Devices: sources of samples, and hands that take commands."""
