"""The digest of the C sources, by which an extension of other sources is found.

The build runs this file by itself, so it imports nothing of the package.
"""

import hashlib
from pathlib import Path

FOLDERS = ("kernel", "twin/c")
"""Folders of the package with C files."""


def digest(package: Path) -> str:
    """Return a digest of the names and the content of all C files of the package."""
    sha256 = hashlib.sha256()
    for path in sorted(path for name in FOLDERS for path in (package / name).glob("*.[ch]")):
        name = path.relative_to(package).as_posix()
        sha256.update(f"{name}\0{path.read_text(encoding='utf-8')}\0".encode())
    return sha256.hexdigest()[:16]
