import pytest

from labelling.page.desk import Desk


@pytest.fixture(scope="session")
def noted():
    """What the browser itself notes of refusals and lost connections; no page can help it."""
    return r"Failed to load resource: .*(\b4(03|04|09|22)\b|\b50\d\b|ERR_CONNECTION)"


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
