"""Rerun: files of recordings, and a live view."""
