import pytest

from live.web.page.fake_service import Service, Tape, made_up


@pytest.fixture(scope="session")
def noted():
    """What the browser itself notes of refusals and lost connections; no page can help it."""
    return r"Failed to load resource: .*(\b40[19]\b|ERR_CONNECTION)|WebSocket connection to"


@pytest.fixture
def service():
    with Service(Tape(*made_up())) as service:
        service.at = 3.5  # all fingers hold
        yield service


@pytest.fixture(scope="module")
def module(browser):
    """A page whose modules are called one by one, as functions."""
    with Service(Tape(*made_up())) as service:
        page = browser.new_page()
        page.goto(service.url)
        yield page
        page.close()
