import pytest

from live.web.page.fake_service import Service, Tape, made_up


@pytest.fixture(scope="session")
def noted():
    """Messages of the browser about refusals and lost connections, which a page cannot prevent."""
    return r"Failed to load resource: .*(\b40[19]\b|ERR_CONNECTION)|WebSocket connection to"


@pytest.fixture
def service():
    with Service(Tape(*made_up())) as service:
        service.at = 3.5  # all fingers hold
        yield service


@pytest.fixture(scope="module")
def module(browser):
    """A page for calling functions of its JavaScript modules."""
    with Service(Tape(*made_up())) as service:
        page = browser.new_page()
        page.goto(service.url)
        yield page
        page.close()
