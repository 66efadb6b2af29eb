import functools
import gc
import os
import re
import shutil
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

import hypothesis
import pytest

# Where the environment forbids bytecode, each of the many child processes would compile NumPy and
# all others again, which takes most of the time of the suite; so would pytest with the tests.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# The workers of pytest-xdist use the processors already; further threads that wait take time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

for _signal, _handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(_signal) is signal.SIG_IGN:  # as in a background job of a shell
        signal.signal(_signal, _handler)


# The checks of a submission try the same examples every time; at home they differ. No example has
# a deadline: pytest limits the time of a test. A test names another number of examples by
# `settings(max_examples=...)`; without it, the quick part tries five.
hypothesis.settings.register_profile("home", deadline=None, max_examples=30)
hypothesis.settings.register_profile("checks", deadline=None, max_examples=30, derandomize=True)
hypothesis.settings.register_profile("quick", deadline=None, max_examples=5)
hypothesis.settings.load_profile("checks" if os.environ.get("CI") else "home")

collect_ignore = [] if find_spec("rerun") else ["packages/holdfast-interop/holdfast_interop/rerun"]
"""Modules that need a package of no group, see .ci/rerun."""
SLOW_FOLDERS = ("tests/cli/label", "tests/docs", "tests/examples")
"""Folders without quick tests."""
SLOW_FILE = re.compile(
    r"^\s*(?:import|from) (?:asyncio|concurrent|cyclonedds|distributed|http|multiprocessing"
    r"|playwright|serial|signal|socket|subprocess|threading|urllib)\b"
    r"|^pytestmark = .*\bslow\b",
    re.MULTILINE,
)
"""Text of a test file without quick tests: an import of processes, threads or servers; a mark."""
SLOW_FIXTURES = {"browser", "data_folder"}
"""Fixtures whose tests are not quick."""


BROWSER = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run",
)  # fmt: skip


@pytest.fixture(scope="session")
def data_folder():
    """Where the real recordings are: HOLDFAST_DATA, or the folder shared beside the project."""
    beside = Path(__file__).parents[1] / "shared" / "data"
    folder = Path(os.environ.get("HOLDFAST_DATA", beside))
    if not folder.is_dir():
        pytest.skip("no real recordings here: set HOLDFAST_DATA to their folder")
    return folder


@pytest.fixture
def short_grasps(monkeypatch):
    """Grasps of the twin that last a few seconds."""
    import msgspec

    from holdfast.twin import simulation

    def short(name):
        return msgspec.structs.replace(profile(name), idle=(0.7, 0.8), hold=2.5)

    profile = simulation.profile
    monkeypatch.setattr(simulation, "profile", short)


# Of a module and no wider: while Playwright runs, its thread has an event loop, and asyncio.run
# of other tests in the same process would be refused.
@pytest.fixture(scope="module")
def browser():
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no Chromium is installed")
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=BROWSER)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def noted():
    """Messages of the browser about refusals and lost connections, which a page cannot prevent."""
    refusals = r"Failed to load resource: .*(\b4(01|03|04|09|22)\b|\b50\d\b|ERR_CONNECTION)"
    return refusals + "|WebSocket connection to"


@pytest.fixture
def visit(browser, noted):
    """A function that opens an address; all complaints of its pages are errors."""
    complaints, contexts = [], []

    def visit(url, size=(1280, 720), scheme="dark", context=None, **words):
        width, height = size
        if context is None:
            context = browser.new_context(
                viewport={"width": width, "height": height}, color_scheme=scheme, **words
            )
            contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(10_000)
        page.on("console", lambda message: message.type == "error" and note(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("dialog", lambda dialog: (complaints.append(dialog.message), dialog.dismiss()))
        page.goto(url)
        return page

    def note(text):
        if not re.match(noted, text):
            complaints.append(text)

    yield visit
    for context in contexts:
        context.close()
    assert complaints == []


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: a test that `-m quick` leaves out")
    config.addinivalue_line("markers", "quick: every test that is not slow; set by `conftest.py`")
    if config.option.markexpr == "quick":
        hypothesis.settings.load_profile("quick")


def pytest_ignore_collect(collection_path, config):
    """Leave out the files without quick tests, so that they are not even imported."""
    if config.option.markexpr == "quick" and is_slow(collection_path):
        return True
    return None


@pytest.hookimpl(tryfirst=True)  # before tests are selected by their marks
def pytest_collection_modifyitems(items):
    for item in items:
        fixtures = SLOW_FIXTURES.intersection(getattr(item, "fixturenames", ()))
        if not (fixtures or is_slow(item.path) or item.get_closest_marker("slow")):
            item.add_marker(pytest.mark.quick)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect without searches for garbage: there is little, and each goes through all tests."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@functools.cache
def is_slow(path):
    """Return whether no test of a file is quick. A doctest is always quick."""
    if not (path.name.startswith("test_") and path.suffix == ".py"):
        return False
    root = Path(__file__).parent
    is_in_slow_folder = any(path.is_relative_to(root / folder) for folder in SLOW_FOLDERS)
    return is_in_slow_folder or SLOW_FILE.search(path.read_text("utf-8")) is not None
