"""The digest of the C sources, by which an extension of other sources is found.

The build runs this file by itself, so it imports nothing of the package.
"""

import hashlib
from pathlib import Path


def digest(folder: Path) -> str:
    """Return a digest of the names and the content of all C files of a folder."""
    found = hashlib.sha256()
    for path in sorted(folder.glob("*.[ch]")):
        found.update(f"{path.name}\0{path.read_text(encoding='utf-8')}\0".encode())
    return found.hexdigest()[:16]
