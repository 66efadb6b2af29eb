import pytest

from labelling.page.fake_service import FakeService


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
