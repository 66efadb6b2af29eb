"""The paths that CONTRIBUTING.md names exist, so that its tour and its recipes can be followed."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "holdfast"
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
NO_FILES = {"utils.py"}
"""Names of files that must not exist."""
PATHS = sorted(set(re.findall(r"`([\w.<>-]*(?:/[\w.<>-]*)+|[\w.<>-]+\.(?:py|md|toml))`", TEXT)))


def section(title):
    """Return the text from a heading to the next one of its level."""
    return re.split(r"\n## ", TEXT.partition(f"\n## {title}\n")[2])[0]


def exists(path):
    """Return whether a path exists; of a name to choose, as `<name>.py`, its folder."""
    return (path.parent if "<" in path.name else path).exists()


@pytest.mark.parametrize("path", PATHS)
def test_a_path_exists(path):
    roots = (ROOT, PACKAGE, *ROOT.glob("packages/*/"))
    found = [root for root in roots if exists(root / path)]
    assert bool(found) is (path not in NO_FILES)


def test_a_recipe_names_paths_from_the_root():
    paths = [path for path in PATHS if f"`{path}`" in section("Recipes")]
    assert len(paths) > 30
    assert [path for path in paths if not exists(ROOT / path)] == []
