"""The compiler of this machine, for the size of the code of a header."""

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from holdfast.exporters.c_header import CHeader

COMPILE_SECONDS = 60.0
"""Time after which the compiler is stopped [s]."""


def code_size(header: CHeader) -> int | None:
    """Return the size of the compiled functions of a header [bytes].

    It is that of this machine's `cc -O2`; None if there is no `cc` or no `size`, or they fail.
    """
    compiler, size = shutil.which("cc"), shutil.which("size")
    if compiler is None or size is None:
        return None
    with TemporaryDirectory() as folder:
        source, compiled = Path(folder) / "model.h", Path(folder) / "model.o"
        source.write_text(header.text)
        options = ["-std=c99", "-O2", "-DHOLDFAST_API=extern", "-x", "c", "-c"]
        try:
            for command in (
                [compiler, *options, str(source), "-o", str(compiled)],
                [size, "-A", str(compiled)],
            ):
                sections = subprocess.run(
                    command, capture_output=True, text=True, timeout=COMPILE_SECONDS, check=True
                ).stdout
        except (OSError, subprocess.SubprocessError):
            return None
    lines = [line.split() for line in sections.splitlines()]
    return sum(int(words[1]) for words in lines if words and words[0].startswith(".text"))
