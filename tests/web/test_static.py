"""Files of the pages: every file that another one names exists, and only once."""

import re
from importlib import resources
from os.path import normpath
from pathlib import Path

import pytest

PACKAGE = Path(str(resources.files("holdfast")))
SHARED = PACKAGE / "web" / "static"
PAGES = [PACKAGE / "live" / "web" / "page", PACKAGE / "labelling" / "page"]
NAMED = re.compile(
    r'(?:src|href)=?(?:", )?["`]([\w./-]+)|^(?:import|export)\b.* from "([^"]+)";$', re.MULTILINE
)


def path_of(page, file, name):
    """Path of a file that another file names; /page and /web are siblings in the URL."""
    folder = "web" if file.parent == SHARED else "page"
    if file.suffix == ".html" or name.startswith("web/"):  # of the document
        folder = "."
    top, *rest = Path(normpath(f"{folder}/{name}")).parts
    return {"page": page, "web": SHARED}[top].joinpath(*rest)


@pytest.mark.parametrize("page", PAGES, ids=["live", "labelling"])
def test_every_file_that_a_page_names_exists(page):
    waiting, seen = [page / "index.html"], set()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        if file.suffix in (".html", ".js"):
            names = [one or two for one, two in NAMED.findall(file.read_text())]
            waiting += [path_of(page, file, name) for name in names]
    assert [str(file) for file in seen if not file.is_file()] == []
    shared = {file for file in SHARED.iterdir() if file.is_file()}
    assert shared <= seen  # a file that only one page uses belongs to that page
    own = {file for file in page.iterdir() if file.suffix in (".js", ".css", ".svg")}
    assert own <= seen
