"""Hooks of mkdocs: pages that are made from the program, and links that leave `docs/`.

Added to the pages of `docs/` are: the help of each verb, the public names of each package, the
examples with what they print, the changelog, and files of the repository that a page links to. A
page that names a verb or an option that does not exist stops a strict build.
"""

import base64
import contextlib
import io
import json
import logging
import posixpath
import re
import runpy
import sys
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import holdfast
import holdfast_grip
from holdfast.cli.app import SUB_VERBS, VERBS, main

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
LOG = logging.getLogger("mkdocs.hooks.holdfast")

FENCE = re.compile(r"^(```+).*?^\1", re.S | re.M)
FOLDER_LINK = re.compile(r"\[([^\]]*)\]\([^):#]*/\)")
LINK = re.compile(r"(?<=\]\()([^)\s]+)(?=\))")
COMMAND = re.compile(
    r"^(?:uv run |time |\.venv/bin/)?holdfast +([a-z]+)\b((?: +[^`\n#|;&]*)?)", re.M
)
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")
GLOBAL_OPTIONS = {"--version", "--help", "--install-completion", "--show-completion"}
GRIP_NAMES = [name for name in holdfast_grip.__all__ if name != "LAWS"]
"""Public names of holdfast-grip with a docstring."""
ASIDE = ("study", "decisions")
"""Folders of `docs/` of whose pages the navigation has a list only."""


def on_config(config: MkDocsConfig) -> None:
    """Add the generated pages and lists of pages to the navigation."""
    sections = {title: pages for section in config.nav or [] for title, pages in section.items()}
    # One page leads to the many that are looked up, so that the navigation stays short.
    sections["Reference"] += ["reference/verbs.md", "reference/python.md"]
    sections["Study"] += ["study/pages.md"]
    sections["Background"] += ["decisions/pages.md"]


def on_files(files: Files, *, config: MkDocsConfig) -> None:
    """Add the pages that are made from the program."""
    pages = {f"reference/{verb}.md": _verb_page(verb) for verb in VERBS}
    pages |= {f"reference/python/{name}.md": _package_page(name) for name in _packages()}
    pages["reference/verbs.md"] = _list("Verbs", {verb: f"{verb}.md" for verb in VERBS})
    python = {f"holdfast.{name}": f"python/{name}.md" for name in _packages()}
    pages["reference/python.md"] = _list("Python", python)
    for folder in ASIDE:
        names = {_title(path): path.name for path in sorted((DOCS / folder).glob("*.md"))}
        pages[f"{folder}/pages.md"] = _list(folder.capitalize(), names)
    pages["gallery.md"] = _gallery()
    pages["changelog.md"] = (ROOT / "CHANGELOG.md").read_text("utf-8")
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    for path in sorted(_linked_files()):
        files.append(File.generated(config, _target(path), abs_src_path=str(path)))


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Check the commands of a page, and write it in the dialect of the generator."""
    source = page.file.src_uri
    if not source.startswith(("reference/", "changelog")):
        _check_commands(markdown, source)
    origin = _origin(source)
    if origin.exists():
        markdown = FOLDER_LINK.sub(lambda link: _folder(link, origin), markdown)
        markdown = LINK.sub(lambda link: _relinked(link[1], origin, source), markdown)
    return _spaced(markdown)


def _origin(source: str) -> Path:
    """Return the file of the repository from which a page comes."""
    if source == "changelog.md":
        return ROOT / "CHANGELOG.md"
    return ROOT / source.removeprefix("files/") if source.startswith("files/") else DOCS / source


def _packages() -> list[str]:
    return [*holdfast._NAMES, "holdfast_grip"]


def _title(path: Path) -> str:
    return path.read_text("utf-8").partition("\n")[0].lstrip("# ")


def _list(title: str, pages: Mapping[str, str]) -> str:
    """Return a page that links to others."""
    links = "\n".join(f"- [{name}]({page})" for name, page in pages.items())
    return f"# {title}\n\n{links}\n"


def _printed(*words: str) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        main(words)
    return out.getvalue()


@cache
def _help_of(verb: str) -> str:
    """Return the help of a verb, and of its commands."""
    commands = [name.split() for name in SUB_VERBS if name.startswith(f"{verb} ")]
    return "\n".join(_printed(*words, "--help-all") for words in ([verb], *commands))


def _verb_page(verb: str) -> str:
    return f"---\nhide: [toc]\n---\n# {verb}\n{VERBS[verb]}\n\n```text\n{_help_of(verb)}```\n"


def _package_page(package: str) -> str:
    """Return a page with the public names of a package."""
    if package == "holdfast_grip":
        names = [f"::: {getattr(holdfast_grip, n).__module__}.{n}" for n in GRIP_NAMES]
        return "\n\n".join(["# holdfast_grip\nOf the package holdfast-grip.", *names]) + "\n"
    parts = [f"# holdfast.{package}\nImport these names from `holdfast`."]
    for name in holdfast._NAMES[package]:
        module = getattr(getattr(holdfast, name), "__module__", f"holdfast.{package}")
        module = module if module.startswith("holdfast") else f"holdfast.{package}"
        parts.append(f"::: {module}.{name}")
    return "\n\n".join(parts) + "\n"


def _gallery() -> str:
    """Return a page with the examples and what they print, and the notebook with its pictures."""
    parts = ["# Gallery\nThe programs of `examples/`, run when this page was made."]
    for path in sorted((ROOT / "examples").glob("*.py")):
        code = path.read_text("utf-8").rstrip()
        parts.append(
            f"## {path.name}\n```python\n{code}\n```\n\nprints\n\n```text\n{_output_of(path)}\n```"
        )
    for path in sorted((ROOT / "examples").glob("*.ipynb")):
        parts += _notebook(path)
    return "\n\n".join(parts) + "\n"


def _output_of(path: Path) -> str:
    words, sys.argv = sys.argv, [path.name]
    out = io.StringIO()
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            contextlib.chdir(folder),
            contextlib.redirect_stdout(out),
        ):
            runpy.run_path(str(path), run_name="__main__")
    finally:
        sys.argv = words
    return out.getvalue().rstrip()


def _notebook(path: Path) -> Iterator[str]:
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield re.sub(r"^#", "##", text, flags=re.M)
            continue
        yield f"```python\n{text}\n```"
        for output in cell.get("outputs", ()):
            yield _shown(output)


def _shown(output: dict[str, Any]) -> str:
    data = output.get("data", {})
    if "image/png" in data:
        image = base64.b64encode(base64.b64decode(data["image/png"])).decode()
        return f'<img alt="Output of the cell" src="data:image/png;base64,{image}">'
    text = "".join(output.get("text", data.get("text/plain", "")))
    return f"```text\n{text.rstrip()}\n```"


def _folder(link: re.Match[str], page: Path) -> str:
    """Return a link to a folder without a page as its text alone."""
    target = (page.parent / link[0].rpartition("(")[2].rstrip(")")).resolve()
    return link[0] if (target / "README.md").exists() else link[1]


def _relinked(link: str, page: Path, source: str) -> str:
    """Return a link of a page, to the copy of a file if it leads out of `docs/`."""
    target, _, anchor = link.partition("#")
    if not target or ":" in target:
        return link
    path = (page.parent / target).resolve()
    if path.is_relative_to(DOCS) and page.is_relative_to(DOCS):
        return link
    uri = path.relative_to(DOCS).as_posix() if path.is_relative_to(DOCS) else _target(path)
    relative = posixpath.relpath(uri, posixpath.dirname(source) or ".")
    return f"{relative}#{anchor}" if anchor else relative


def _target(path: Path) -> str:
    """Return the path in the site of a file that is outside `docs/`."""
    if path == ROOT / "README.md":
        return "index.md"
    name = path.relative_to(ROOT).as_posix()
    return f"files/{name}/README.md" if path.is_dir() else f"files/{name}"


@cache
def _linked_files() -> frozenset[Path]:
    """Return the files outside `docs/` to which its pages link, and those to which these do."""
    found: set[Path] = set()
    pages = [*DOCS.rglob("*.md"), ROOT / "CHANGELOG.md"]
    for page in pages:  # which grows
        for link in LINK.findall(FENCE.sub("", page.read_text("utf-8"))):
            path = (page.parent / link.partition("#")[0]).resolve()
            outside = path.exists() and not path.is_relative_to(DOCS) and path != ROOT
            if outside and path.is_relative_to(ROOT) and path != ROOT / "README.md":
                file = path / "README.md" if path.is_dir() else path
                pages += [file] if file.suffix == ".md" and file not in found else []
                found.add(file)
    return frozenset(found)


def _check_commands(markdown: str, source: str) -> None:
    """Warn of verbs and options that do not exist."""
    code = [match[0] for match in FENCE.finditer(markdown)]
    spans = re.findall(r"(?<=`)holdfast [^`\n]+(?=`)", FENCE.sub("", markdown))
    for text in [*code, *spans]:
        for verb, rest in COMMAND.findall(re.sub(r"\\\n +", "", text)):
            if verb not in VERBS:
                LOG.warning("%s names the verb %s, which does not exist", source, verb)
                continue
            known = set(OPTION.findall(_help_of(verb))) | GLOBAL_OPTIONS
            for option in sorted(set(OPTION.findall(rest)) - known):
                LOG.warning("%s: holdfast %s has no option %s", source, verb, option)


def _spaced(markdown: str) -> str:
    """Return the text with an empty line before each list and table that follows a paragraph."""
    lines: list[str] = []
    fenced = False
    for line in markdown.splitlines():
        if line.startswith("```"):
            fenced = not fenced
        before = lines[-1] if lines else ""
        begins = _is_item(line) and not _is_item(before)
        begins |= line.startswith("|") and not before.startswith("|")
        if not fenced and begins and before.strip() and not before.startswith(("#", "  ")):
            lines.append("")
        lines.append(line)
    return "\n".join(lines) + "\n"


def _is_item(line: str) -> bool:
    return re.match(r"([-*]|\d+\.) ", line) is not None
