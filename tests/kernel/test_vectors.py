import re
import subprocess
from pathlib import Path

import pytest

import holdfast

PROGRAM = Path(__file__).with_name("check_vectors.c")
SOURCES = Path(holdfast.__file__).with_name("kernel")
CC = ("cc", "-std=c99", "-O2", "-ffp-contract=off", "-I", SOURCES)
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
JOINED = re.compile(r'#include "(\w+\.c)"')


def printed(folder, *words):
    """Return what the program prints, compiled with these words."""
    run = folder / "check"
    subprocess.run([*CC, *WARNINGS, *words, "-o", run, "-lm"], check=True)
    done = subprocess.run([run], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize("options", [(), ("-DHOLDFAST_VECTORS_FIXED", "-DHOLDFAST_SINGLE")])
def test_the_program_without_python(tmp_path, options):
    assert "260 samples, 0 wrong" in printed(tmp_path, PROGRAM, *options)


def test_files_compiled_alone_compute_what_the_joined_file_does(tmp_path):
    names = JOINED.findall((SOURCES / "holdfast.c").read_text())
    subprocess.run([*CC, "-c", *(SOURCES / name for name in names)], check=True, cwd=tmp_path)
    objects = [tmp_path / name.replace(".c", ".o") for name in names]
    linked = printed(tmp_path, "-DHOLDFAST_VECTORS_LINKED", PROGRAM, *objects)
    assert linked == printed(tmp_path, PROGRAM)
