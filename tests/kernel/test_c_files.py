"""The C files compile without a warning, by the compilers that are installed."""

import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "src" / "holdfast"
WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
EXTENSION = (
    *("-ffp-contract=off", "-DPy_LIMITED_API=0x030B0000", "-DHF_API=extern"),
    '-DHOLDFAST_SOURCES=""',
    *("-isystem", sysconfig.get_path("include")),
)
KERNEL = PACKAGE / "kernel"
ALONE = sorted(set(KERNEL.glob("*.c")) - set(KERNEL.glob("module*.c")))


def compiled(compiler, path, folder, *flags):
    """Return the exit code and the messages of a compiler for a file."""
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler} here")
    command = (compiler, *WARNINGS, *flags, "-c", str(path), "-o", str(folder / "object"))
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize(
    "name", ["kernel/module.c", "kernel/module_avx2.c", "kernel/offline.c", "twin/c/module.c"]
)
def test_no_warning_as_the_extension_is_built(compiler, name, tmp_path):
    assert compiled(compiler, PACKAGE / name, tmp_path, "-O3", *EXTENSION) == (0, "")


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("path", ALONE, ids=lambda path: path.name)
def test_a_file_of_the_kernel_alone(compiler, path, tmp_path):
    assert compiled(compiler, path, tmp_path, "-Wmissing-prototypes") == (0, "")
