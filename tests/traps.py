"""What another program could put in place of a file that only its place names."""

import os
from pathlib import Path

import pytest

TRAPS = {
    "pipe": os.mkfifo,
    "folder": Path.mkdir,
    "link to a device": lambda path: path.symlink_to("/dev/zero"),
    "link to a file": lambda path: path.symlink_to(__file__),
    "link to nothing": lambda path: path.symlink_to("none"),
}
"""Each makes one at a path; the text of the refusal has its first word."""

traps = pytest.mark.parametrize(("word", "trap"), [(k.split()[0], x) for k, x in TRAPS.items()])
