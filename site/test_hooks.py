"""What stops a strict build of the site, and what the generated pages hold."""

import logging
import re
import shlex
import subprocess
import sys

import hooks
import pytest

import holdfast
from holdfast.cli.app import VERBS


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        ("```sh\nholdfast squeeze hand\n```", "page.md names the verb squeeze"),
        ("`holdfast detect m.json r --fast`", "holdfast detect has no option --fast"),
        ("```\nuv run holdfast train d \\\n  --quickly\n```", "has no option --quickly"),
    ],
)
def test_a_command_that_does_not_exist_is_a_warning(caplog, text, warning):
    with caplog.at_level(logging.WARNING):
        hooks._check_commands(f"Run\n\n{text}\n", "page.md")
    assert warning in caplog.text


@pytest.mark.parametrize(
    "text",
    [
        "```sh\nholdfast detect m.json r --json > out  # states\n```",
        "`holdfast label auto tracking a.mcap --motion stage.csv`",
        "`holdfast --version`",
        "holdfast squeezes nothing",
        "```python\nimport holdfast as hf\n```",
    ],
)
def test_what_exists_is_none(caplog, text):
    hooks._check_commands(f"Run\n\n{text}\n", "page.md")
    assert caplog.text == ""


def test_every_verb_and_every_public_name_has_a_page():
    pages = "".join(hooks._package_page(package) for package in hooks._packages())
    assert all(f".{name}\n" in pages for name in holdfast.__all__ if not name.startswith("__"))
    for verb in VERBS:
        assert f"Usage: holdfast {verb}" in hooks._verb_page(verb)


def test_a_list_after_a_paragraph_gets_an_empty_line():
    assert hooks._spaced("Two:\n- a\n- b\n") == "Two:\n\n- a\n- b\n"
    assert hooks._spaced("```\nx\n- a\n```\n") == "```\nx\n- a\n```\n"


def test_links_out_of_the_folder_lead_to_copies():
    page = hooks.DOCS / "live.md"
    assert hooks._relinked("../SECURITY.md#scope", page, "live.md") == "files/SECURITY.md#scope"
    assert hooks._relinked("grip.md#safety", page, "live.md") == "grip.md#safety"
    assert hooks._relinked("https://x.org/", page, "live.md") == "https://x.org/"
    deep = hooks.DOCS / "study" / "skin.md"
    assert hooks._relinked("../../README.md", deep, "study/skin.md") == "../index.md"


def test_links_of_files_outside_the_folder_have_their_copies():
    assert hooks.ROOT / "examples" / "c" / "fingertip.ino" in hooks._linked_files()


@pytest.mark.parametrize(("link", "code"), [("other.md#part", 0), ("no.md", 1), ("other.md#x", 1)])
def test_a_broken_link_fails_the_check(tmp_path, link, code):
    """With the command of `.ci/run` and the validation of `mkdocs.yml`."""
    run = (hooks.ROOT / ".ci" / "run").read_text("utf-8")
    options = shlex.split(re.search(r"mkdocs build (.*)", run)[1])
    validation = (hooks.ROOT / "mkdocs.yml").read_text("utf-8").partition("validation:")[2]
    validation = validation.partition("\nnav:")[0]
    (tmp_path / "mkdocs.yml").write_text(f"site_name: x\nvalidation:{validation}\n")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text(f"[a]({link})")
    (tmp_path / "docs" / "other.md").write_text("# Part")
    build = [sys.executable, "-m", "mkdocs", "build", *options]
    done = subprocess.run(build, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert (f"'{link.partition('#')[0]}'" in done.stderr) == bool(code)


def test_the_front_page_installs_what_there_is():
    """Nothing is on a package index before the first release."""
    page = (hooks.DOCS / "index.md").read_text("utf-8")
    assert "uv run holdfast demo" in page
    assert not re.search(r"pip install [^-.]", page)


def test_the_navigation_is_short():
    """A person finds a page by eye; what is looked up stands aside."""
    text = (hooks.ROOT / "mkdocs.yml").read_text("utf-8").partition("\nnav:\n")[2]
    nav = re.findall(r"[\w/-]+\.md", text)
    assert len(nav) + 4 <= 45  # the hooks add lists of verbs, names, decisions and the study


def test_the_pages_are_short():
    """In words: the pages for users, and the evidence with the decisions."""
    words = {True: 0, False: 0}
    for page in hooks.DOCS.rglob("*.md"):
        aside = page.relative_to(hooks.DOCS).as_posix().startswith(("study", "decisions"))
        words[aside] += len(page.read_text("utf-8").split())
    assert words[False] <= 22_000
    assert words[True] <= 20_000
