import math

import pytest

from holdfast.cli.terminal import progress


@pytest.fixture(autouse=True)
def terminal_width(monkeypatch):
    """Make tables and paragraphs 80 columns wide on every machine."""
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture(autouse=True)
def no_progress_messages(monkeypatch):
    """Print no line of progress on stderr, even where a machine takes minutes."""
    monkeypatch.setattr(progress, "PROGRESS_INTERVAL", math.inf)
