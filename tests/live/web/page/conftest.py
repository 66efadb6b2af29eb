import pytest

from live.web.page.fake_service import Service


@pytest.fixture
def service():
    with Service() as service:
        yield service


@pytest.fixture(scope="module")
def module(browser):
    """A page for calling functions of its JavaScript modules."""
    with Service() as service:
        page = browser.new_page()
        page.goto(service.url)
        yield page
        page.close()
