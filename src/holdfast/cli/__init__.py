"""The command `holdfast`: one file for each verb, one line in `app.py` to add one."""

from holdfast.cli.app import main

__all__ = ["main"]
