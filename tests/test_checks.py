"""What makes `.ci/run` fail: a check of a lane, races in tests, a program that is missing."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

RUN = Path(__file__).parents[1] / ".ci" / "run"
PROGRAMS = ("chromium", "gcc", "g++", "clang", "clang++", "awk")
SCRIPTS = (".ci/wheel", ".ci/slim", ".ci/versions", "benchmarks/kernel_check/kernel.sh",
           "benchmarks/kernel_check/sanitized_binding.sh")  # fmt: skip
STUB = '#!/bin/sh\n[ "$FAILS" != "$(basename $0) $*" ]\n'
"""A program that fails where FAILS names it with its words."""


@pytest.fixture
def clone(tmp_path):
    """A folder with `.ci/run`, in which all that it calls does nothing."""
    for name in (*SCRIPTS, *(f"bin/{program}" for program in (*PROGRAMS, "uv"))):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STUB)
        path.chmod(0o755)
    shutil.copy(RUN, tmp_path / ".ci")
    for name in ("dist/holdfast-0-manylinux.whl", ".pytest_cache/v/cache/lastfailed"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text('{"tests/test_a.py::test_b": true}')
    return tmp_path


def run(clone, fails="", path=None):
    path = f"{clone}/bin:{path or os.environ['PATH']}"
    environment = {**os.environ, "FAILS": fails, "PATH": path}
    done = subprocess.run(
        [shutil.which("bash"), clone / ".ci" / "run"], env=environment, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def test_all_checks_pass(clone):
    code, out = run(clone)
    assert code == 0
    assert out.count("== Failed") == 0
    assert out.splitlines()[-2].startswith("== Tests and doctests")


@pytest.mark.parametrize(
    ("fails", "last"),
    [
        ("uv run mypy", "a check failed: see above"),
        ("kernel.sh 20", "a check failed: see above"),
        ("wheel ", "a check failed: see above"),
    ],
)
def test_one_failure_fails_the_run(clone, fails, last):
    code, out = run(clone, fails)
    assert (code, out.splitlines()[-1]) == (1, last)


@pytest.mark.parametrize(("n_failed", "code"), [(1, 0), (2, 1)])
def test_one_test_that_passes_alone_is_said_and_two_fail_the_run(clone, n_failed, code):
    failed = {f"tests/test_a.py::test_{k}": True for k in range(n_failed)}
    (clone / ".pytest_cache/v/cache/lastfailed").write_text(json.dumps(failed))
    got, out = run(clone, "uv run pytest")
    assert got == code
    assert "what failed passes alone: it has a race, to be mended next" in out.splitlines()


def test_a_program_that_is_missing_fails_the_run(clone, tmp_path):
    (clone / "bin" / "awk").unlink()
    few = tmp_path / "few"
    few.mkdir()
    for name in ("bash", "sh", "dirname", "id"):
        (few / name).symlink_to(shutil.which(name))
    code, out = run(clone, path=few)
    assert (code, out) == (1, "missing, so not all checks can run: awk \n")
