import re
import subprocess
import sys
from pathlib import Path

import pytest

import holdfast

WRITER = Path(__file__).with_name("write_vectors.py")
PROGRAM = Path(__file__).with_name("check_vectors.c")
SOURCES = Path(holdfast.__file__).with_name("kernel")
CC = ("cc", "-std=c99", "-O2", "-ffp-contract=off", "-I", SOURCES)
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
JOINED = re.compile(r'#include "(\w+\.c)"')


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the vectors."""
    folder = tmp_path_factory.mktemp("vectors")
    with (folder / "vectors.h").open("w") as file:
        subprocess.run([sys.executable, WRITER], stdout=file, check=True)
    return folder


def printed(folder, *words):
    """Return what the program prints, compiled with these words."""
    run = folder / "check"
    subprocess.run([*CC, *WARNINGS, "-I", folder, *words, "-o", run, "-lm"], check=True)
    done = subprocess.run([run], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize("options", [(), ("-DHOLDFAST_VECTORS_FIXED", "-DHOLDFAST_SINGLE")])
def test_the_program_without_python(folder, options):
    assert "260 samples, 0 wrong" in printed(folder, PROGRAM, *options)


def test_files_compiled_alone_compute_what_the_joined_file_does(folder):
    names = JOINED.findall((SOURCES / "holdfast.c").read_text())
    subprocess.run([*CC, "-c", *(SOURCES / name for name in names)], check=True, cwd=folder)
    objects = [folder / name.replace(".c", ".o") for name in names]
    linked = printed(folder, "-DHOLDFAST_VECTORS_LINKED", PROGRAM, *objects)
    assert linked == printed(folder, PROGRAM)
