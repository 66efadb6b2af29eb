import pytest


@pytest.fixture(autouse=True)
def terminal_width(monkeypatch):
    """Make tables and paragraphs 80 columns wide on every machine."""
    monkeypatch.setenv("COLUMNS", "80")
