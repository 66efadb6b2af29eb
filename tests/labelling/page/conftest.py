import pytest

from labelling.page.fake_service import FakeService


@pytest.fixture(scope="session")
def noted():
    """Messages of the browser about refusals and lost connections, which a page cannot prevent."""
    return r"Failed to load resource: .*(\b4(03|04|09|22)\b|\b50\d\b|ERR_CONNECTION)"


@pytest.fixture
def service():
    with FakeService() as service:
        yield service


@pytest.fixture(scope="module")
def module(browser):
    """A page for calling functions of its JavaScript modules."""
    with FakeService() as service:
        page = browser.new_page()
        page.goto(service.url)
        yield page
        page.close()
