"""Lines of code of all tracked files, without blanks, comments and docstrings.

    python benchmarks/lines.py                 # this checkout, beside the totals of --at
    python benchmarks/lines.py --at f7d623e5   # with the same counts of a commit
    python benchmarks/lines.py --rooms         # each folder, at most three deep

Python, C, JavaScript, CSS, HTML, shell and awk count, as the formatters leave them; `# fmt: skip`
is counted, because it hides lines from the formatter. Vendored files and data are listed, and do
not count. Words are those of README, docs and the pages of the packages.
"""

import argparse
import ast
import io
import re
import subprocess
import tarfile
import tempfile
from collections import Counter
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
C_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
JS_COMMENT = re.compile(r"/\*.*?\*/|^\s*//[^\n]*", re.DOTALL | re.MULTILINE)
HTML_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
VENDORED = re.compile(r"(^|/)uplot/")
DATA = {".csv", ".json", ".mcap", ".parquet", ".png", ".jpg", ".webp", ".svg", ".lock"}
TESTS = re.compile(r"(^|/)tests?/|^conftest\.py$")
PAGES = {".js", ".css", ".html"}
GROUPS = ("src", "packages", "lab", "benchmarks", "pages", "tests", "other")
"""`pages` are JavaScript, CSS and HTML outside the tests; `other` is `.ci`, `setup.py`, ..."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--at", help="commit to compare with")
    parser.add_argument("--rooms", action="store_true", help="count each folder, not each group")
    options = parser.parse_args()
    group = room_of if options.rooms else group_of
    now, before = counts(ROOT, group), Counter[str]()
    if options.at:
        with tempfile.TemporaryDirectory() as folder:
            before = counts(checkout(options.at, Path(folder)), group)
    rows = sorted({*now, *before}, key=lambda row: (row.startswith(" "), row))
    for row in rows if options.rooms else sorted(rows, key=order):
        past = f"{before[row]:>9,}" if options.at else ""
        print(f"{row.strip():<44}{now[row]:>9,}{past}")


def order(row: str) -> tuple[int, str]:
    return (GROUPS.index(row) if row in GROUPS else len(GROUPS), row)


def counts(root: Path, group) -> Counter[str]:
    """Return the code lines of each group, and rows of all else that is said about a checkout."""
    rows: Counter[str] = Counter()
    for name in tracked(root):
        path = root / name
        text = path.read_text("utf-8", errors="replace")
        kind = path.suffix or ("sh" if text.startswith("#!") else "")
        if path.suffix == ".md" and (name.startswith("docs/") or name == "README.md"):
            rows[" words of docs and README"] += len(text.split())
        if VENDORED.search(name) or path.suffix in DATA:
            rows[f" kB vendored or data: {PurePosixPath(name).parent}"] += path.stat().st_size >> 10
        elif (code := code_lines(kind, text)) is not None:
            rows[group(name)] += code
            rows[" code lines without tests"] += code * (group_of(name) != "tests")
            rows[" # fmt: skip"] += text.count("# fmt: skip")
    return rows


def tracked(root: Path) -> list[str]:
    """Return the names of the files of a checkout; of an archive, of all files."""
    if (root / ".git").exists():
        listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, check=True)
        names = listed.stdout.decode().splitlines()
        return [name for name in names if (root / name).is_file()]
    return [path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()]


def group_of(name: str) -> str:
    if TESTS.search(name):
        return "tests"
    first = name.partition("/")[0]
    if first in ("src", "packages", "lab") and PurePosixPath(name).suffix in PAGES:
        return "pages"
    return first if first in GROUPS else "other"


def room_of(name: str) -> str:
    return "/".join(PurePosixPath(name).parent.parts[:3]) or "."


def code_lines(kind: str, text: str) -> int | None:
    """Return the code lines of a file; None if its kind does not count."""
    match kind:
        case ".py":
            return python_lines(text)
        case ".c" | ".h":
            return filled(C_COMMENT.sub("", text))
        case ".js" | ".css":
            return filled(JS_COMMENT.sub("", text))
        case ".html":
            return filled(HTML_COMMENT.sub("", text))
        case ".sh" | ".awk" | "sh":
            return filled(re.sub(r"^\s*#[^\n]*", "", text, flags=re.MULTILINE))
    return None


def filled(text: str) -> int:
    return sum(bool(line.strip()) for line in text.split("\n"))


def python_lines(text: str) -> int:
    lines = text.split("\n")
    code = {n for n, line in enumerate(lines, 1) if line.strip() and line.strip()[0] != "#"}
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else []:
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                code -= set(range(statement.lineno, (statement.end_lineno or 0) + 1))
    return len(code)


def checkout(commit: str, folder: Path) -> Path:
    """Extract the files of a commit into a folder, and return it."""
    archive = subprocess.run(
        ["git", "archive", "--format=tar", commit], cwd=ROOT, capture_output=True, check=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        tar.extractall(folder, filter="data")
    return folder


if __name__ == "__main__":
    main()
