"""The C files compile without a warning, by the compilers that are installed."""

import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "src" / "holdfast"
FLAGS = (
    *("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"),
    *("-ffp-contract=off", "-DPy_LIMITED_API=0x030B0000", "-DHF_API=extern"),
    '-DHOLDFAST_SOURCES=""',
    *("-isystem", sysconfig.get_path("include")),
)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize(
    "name",
    [
        *(f"kernel/{name}.c" for name in ("module", "haar", "force", "kernel", "offline")),
        "twin/c/module.c",
    ],
)
def test_no_warning(compiler, name, tmp_path):
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler} here")
    command = (compiler, *FLAGS, "-O3", "-c", str(PACKAGE / name), "-o", str(tmp_path / "object"))
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert (done.returncode, done.stderr) == (0, "")
