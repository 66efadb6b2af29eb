import subprocess
from pathlib import Path

import pytest

import holdfast

PROGRAM = Path(__file__).with_name("check_vectors.c")
SOURCES = Path(holdfast.__file__).with_name("kernel")
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")


@pytest.mark.parametrize("options", [(), ("-DHOLDFAST_VECTORS_FIXED", "-DHOLDFAST_SINGLE")])
def test_the_program_without_python(tmp_path, options):
    words = ["cc", "-std=c99", "-O2", "-ffp-contract=off", *WARNINGS, *options]
    run = tmp_path / "check"
    subprocess.run([*words, "-I", SOURCES, PROGRAM, "-o", run, "-lm"], check=True)
    done = subprocess.run([run], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout
    assert "260 samples, 0 wrong" in done.stdout
