"""A browser, and label pages in it that must not complain."""

import re
import shutil

import pytest

from labelling.page.desk import Desk

OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run",
)  # fmt: skip
# The browser itself notes every refusal and every lost connection; the page cannot help it.
NOTED = re.compile(r"Failed to load resource: .*(\b4(03|04|09|22)\b|\b50\d\b|ERR_CONNECTION)")


# Of a module and no wider: while Playwright runs, its thread has an event loop, and asyncio.run
# of other tests in the same process would be refused.
@pytest.fixture(scope="module")
def browser():
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no Chromium is installed")
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=OPTIONS)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser):
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
        if not NOTED.match(text):
            complaints.append(text)

    yield visit
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture
def desk():
    with Desk() as desk:
        yield desk


@pytest.fixture(scope="module")
def module(browser):
    """A page whose modules are called one by one, as functions."""
    with Desk() as desk:
        page = browser.new_page()
        page.goto(desk.url)
        yield page
        page.close()
