import os
import subprocess
import sys
from functools import partial

import pytest
from joblib.externals.loky import get_reusable_executor

from holdfast.compile_notice import COMPILE_LOGGER, COMPILING, compiling_shown, is_waiting
from holdfast.parallel import Engine

pytestmark = pytest.mark.slow

KERNEL = """
from holdfast.compiled import compiled
@compiled
def {name}(x):
    return x + 1
"""


@pytest.fixture(autouse=True)
def line_about_compiling(no_line_about_compiling, monkeypatch):
    monkeypatch.setattr(COMPILE_LOGGER, "disabled", False)


@pytest.fixture
def kernels(tmp_path):
    """Write two tiny kernels into a module, which the verb `info` calls."""
    text = "".join(KERNEL.format(name=name) for name in ("first", "second"))
    (tmp_path / "tiny_kernels.py").write_text(text)
    return tmp_path


PROGRAM = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from holdfast.cli import app, main
def verb(path: str) -> None:
    "Call the kernels."
    from holdfast.cli.terminal.console import print_json
    import tiny_kernels
    print_json(tiny_kernels.first(1) + tiny_kernels.second(1.0))
app.load_verb = lambda name: verb
sys.exit(main(["info", "x"]))
"""


def test_the_first_compilation_is_announced_once_and_not_from_the_cache(kernels):
    run = partial(
        subprocess.run,
        [sys.executable, "-c", PROGRAM, str(kernels)],
        capture_output=True,
        text=True,
        timeout=100,
        env={**os.environ, "NUMBA_CACHE_DIR": str(kernels / "cache")},
    )
    first, second = run(), run()
    assert (first.returncode, first.stdout, first.stderr) == (0, "4.0\n", f"{COMPILING}\n")
    assert (second.returncode, second.stdout, second.stderr) == (0, "4.0\n", "")


def compile_a_kernel(_):
    """Compile a function that is in no cache."""
    from holdfast.compiled import numba  # with the listener that logs compilations

    return numba.njit(lambda x: x + 1)(1)


def test_a_library_prints_nothing(capfd):
    assert compile_a_kernel(0) == 2
    assert capfd.readouterr() == ("", "")


def test_a_process_of_the_command_line_announces_it(capfd):
    get_reusable_executor().shutdown(wait=True)  # workers write to the stderr that they began with
    with compiling_shown():
        assert list(Engine(2).map_ordered(compile_a_kernel, [(0,)])) == [2]
        assert is_waiting()
    assert capfd.readouterr() == ("", f"{COMPILING}\n")


def test_the_logger_is_as_before(capfd):
    before = list(COMPILE_LOGGER.handlers), COMPILE_LOGGER.level
    with compiling_shown():
        assert compile_a_kernel(0) == 2
        assert not is_waiting()
    assert (list(COMPILE_LOGGER.handlers), COMPILE_LOGGER.level) == before
    assert capfd.readouterr().err == f"{COMPILING}\n"
