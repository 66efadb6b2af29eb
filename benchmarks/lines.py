"""Lines of code by room: what is neither docstring, comment nor blank, after the formatter.

    python benchmarks/lines.py                   # this checkout
    python benchmarks/lines.py --at v0.2.0       # a commit, beside this checkout
    python benchmarks/lines.py --sum src/holdfast/model,lab/holdfast_lab/study/evaluation

What moves from one folder to another changes nothing in the total. Public names are functions,
classes and methods without a leading underscore; the docstrings of the modules count to none.
"""

import argparse
import ast
import io
import re
import subprocess
import tarfile
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path, PurePosixPath

TREES = ("src", "packages", "lab", "benchmarks")
TESTS = re.compile(r"(^|/)tests?/")
HIDDEN = re.compile(r"(^|/)(\.|__pycache__)")
C_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
Files = dict[str, Counter[str]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--at", help="commit to compare with")
    parser.add_argument("--sum", help="folders, separated by commas, to sum in a last row")
    options = parser.parse_args()
    now, before = counted(Path(__file__).parents[1]), None
    if options.at:
        with tempfile.TemporaryDirectory() as folder:
            before = counted(checkout(options.at, Path(folder)))
    print(f"{'room':<34}{'code':>8}{'docstring':>11}{'names':>8}{'a name':>8}{'before':>9}")
    for room in sorted({room_of(path) for path in (*now, *(before or {}))}):
        print_row(room, now, before, lambda path, room=room: room_of(path) == room)
    print_row("total", now, before, lambda _: True)
    if options.sum:
        folders = tuple(f"{name.rstrip('/')}/" for name in options.sum.split(","))
        print_row("of the folders", now, before, lambda path: path.startswith(folders))


def print_row(title: str, now: Files, before: Files | None, is_in: Callable[[str], bool]) -> None:
    """Print the sums of the files that are in a room."""
    counts = sum((counts for path, counts in now.items() if is_in(path)), Counter())
    past = ""
    if before is not None:
        past = f"{sum(counts['code'] for path, counts in before.items() if is_in(path)):>9,}"
    share = counts["public docstring"] / max(counts["names"], 1)
    print(f"{title:<34}{counts['code']:>8,}{counts['docstring']:>11,}{counts['names']:>8,}"
          f"{share:>8.2f}{past}")  # fmt: skip


def checkout(commit: str, folder: Path) -> Path:
    """Extract the files of a commit into a folder, and return it."""
    archive = subprocess.run(
        ["git", "archive", "--format=tar", commit, "--", "."],
        cwd=Path(__file__).parents[1], capture_output=True, check=True,
    ).stdout  # fmt: skip
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        tar.extractall(folder, filter="data")
    return folder


def counted(root: Path) -> Files:
    """Return the counts of each file of code, without tests."""
    files: Files = {}
    for tree in TREES:
        for path in sorted((root / tree).rglob("*")):
            name = path.relative_to(root).as_posix()
            if TESTS.search(name) or HIDDEN.search(name) or not path.is_file():
                continue
            if path.suffix == ".py":
                files[name] = count_python(path.read_text("utf-8"))
            elif path.suffix in {".c", ".h"}:
                files[name] = count_c(path.read_text("utf-8"))
    return files


def room_of(path: str) -> str:
    """Return the room of a file: at most three folders."""
    return "/".join(PurePosixPath(path).parent.parts[:3])


def count_python(text: str) -> Counter[str]:
    lines = text.split("\n")
    code = {n for n, line in enumerate(lines, 1) if line.strip() and line.strip()[0] != "#"}
    counts: Counter[str] = Counter()
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        for k, statement in enumerate(body if isinstance(body, list) else []):
            if is_text(statement):
                span = range(statement.lineno, (statement.end_lineno or statement.lineno) + 1)
                code -= set(span)
                counts["docstring"] += len(span)
                definition = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
                if k == 0 and definition and not node.name.startswith("_"):
                    counts["public docstring"] += len(span)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            counts["names"] += not node.name.startswith("_")
    counts["code"] = len(code)
    return counts


def is_text(statement: ast.stmt) -> bool:
    value = statement.value if isinstance(statement, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def count_c(text: str) -> Counter[str]:
    return Counter(code=sum(bool(line.strip()) for line in C_COMMENT.sub("", text).split("\n")))


if __name__ == "__main__":
    main()
