"""The paths that CONTRIBUTING.md, the tour and the recipes name exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "holdfast"
PAGES = ("CONTRIBUTING.md", "docs/tour.md", "docs/recipes.md")
TEXT = "".join((ROOT / page).read_text("utf-8") for page in PAGES)
NO_FILES = {"utils.py"}
"""Names of files that must not exist."""
PATHS = sorted(set(re.findall(r"`([\w.<>-]*(?:/[\w.<>-]*)+|[\w.<>-]+\.(?:py|md|toml))`", TEXT)))


def exists(path):
    """Return whether a path exists; of a name to choose, as `<name>.py`, its folder."""
    return (path.parent if "<" in path.name else path).exists()


@pytest.mark.parametrize("path", PATHS)
def test_a_path_exists(path):
    roots = (ROOT, PACKAGE, *ROOT.glob("packages/*/"))
    found = [root for root in roots if exists(root / path)]
    assert bool(found) is (path not in NO_FILES)
