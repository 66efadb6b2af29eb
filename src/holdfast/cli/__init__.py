"""The command line `holdfast`: one file for each verb, listed in `app.py`."""

from holdfast.cli.app import main

__all__ = ["main"]
