"""Run the fenced blocks of a page as a reader does, in order, in one folder.

A comment directly above a block says what is special about it:

    <!-- not run: REASON -->   its `holdfast` commands are only checked for their options
    <!-- until Ctrl-C -->      the command runs until it is interrupted
    <!-- live -->              the Python program runs until its source ends

Blocks of `sh` and `python` run, others (`json`, `text`, ...) do not. A `holdfast` command without
a pipe runs in this process, which saves the time to load the package. A block of `text` below a
block that ran is its output: these lines, one after the other, are among those that it printed.
Spaces, decimal fractions and folders may differ.
"""

import io
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

from holdfast.cli import app, main

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
PATIENCE = 120.0
FENCE = re.compile(
    r"^(?:<!-- (?P<note>[^\n]*?) -->\n)?```(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S
)
SHELL_SYMBOLS = re.compile(r"[|><&;$*`]")
VARYING = re.compile(r"\d+\.\d+|[\w./-]*/")
"""What differs from run to run: decimal fractions, and the folder of a path."""


class Block(NamedTuple):
    page: str
    line: int
    language: str
    text: str
    note: str
    section: str

    @property
    def location(self) -> str:
        return f"{self.page}:{self.line}"


def blocks_of(path: Path) -> list[Block]:
    text = path.read_text("utf-8")
    return [
        Block(path.name, text.count("\n", 0, found.start()) + 1, found["language"],
              found["text"], found["note"] or "", section_at(text, found.start()))
        for found in FENCE.finditer(text)
    ]  # fmt: skip


def section_at(text: str, offset: int) -> str:
    """The last heading of the second level before an offset in a page."""
    return ["", *re.findall(r"^## (.*)$", text[:offset], re.M)][-1]


def links_of(path: Path) -> list[tuple[str, str]]:
    """The (file, anchor) of each link of a page to a file, or within the page."""
    text = FENCE.sub("", path.read_text("utf-8"))
    found = re.findall(r"\]\(([^)#\s:]*)(?:#([^)\s]*))?\)", text)
    return [(target, anchor) for target, anchor in found if target or anchor]


def anchors_of(path: Path) -> set[str]:
    """The anchors of a page: its own, and those of its headings as GitHub makes them."""
    text = FENCE.sub("", path.read_text("utf-8"))
    titles = re.findall(r"^#+ (.*)$", text, re.M)
    own = set(re.findall(r'<a id="([^"]+)">', text))
    return own | {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def run_page(
    path: Path, replace: Mapping[str, str] | None = None, sections: Collection[str] | None = None
) -> int:
    """Run the blocks of a page in the working folder; return how many ran.

    Args:
        path: of the page.
        replace: texts that stand for something else here, such as the address of a hand.
        sections: only blocks under these headings; by default all blocks.
    """
    names: dict[str, object] = {"__name__": "__main__"}
    n_run, printed = 0, None
    for block in blocks_of(path):
        if sections is not None and block.section not in sections:
            continue
        if block.language == "text" and printed is not None:
            check_output(block, printed)
            continue
        text = block.text
        for old, new in (replace or {}).items():
            text = text.replace(old, new)
        printed = run_printing(block._replace(text=text), names)
        n_run += printed is not None
    return n_run


def run_printing(block: Block, names: dict[str, object]) -> str | None:
    """Run a block; return what it printed, which is printed again, or None if it did not run."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(err):
            ran = run_block(block, names)
    finally:
        sys.stdout.write(out.getvalue())
        sys.stderr.write(err.getvalue())
    return out.getvalue() + err.getvalue() if ran else None


def check_output(block: Block, printed: str) -> None:
    """Check that the lines of a block are lines of what was printed, one after the other."""
    shown, found = ([plain(line) for line in text.splitlines()] for text in (block.text, printed))
    starts = range(len(found) - len(shown) + 1)
    is_there = any(found[k : k + len(shown)] == shown for k in starts)
    assert is_there, f"{block.location}: this is not what was printed:\n{printed}"


def plain(line: str) -> str:
    return " ".join(VARYING.sub("", line).split())


def run_block(block: Block, names: dict[str, object]) -> bool:
    """Run a block; return whether it ran."""
    kind = block.note.partition(": ")[0]
    if kind == "not run":
        check_options(block)
        return False
    if block.language == "sh":
        for line in lines_of(block.text):
            run_line(line, block, until="Ctrl-C stops it" if kind == "until Ctrl-C" else None)
    elif block.language == "python" and ">>>" not in block.text:
        exec(compile("\n" * block.line + block.text, block.page, "exec"), names)
    else:
        return False
    return True


def lines_of(text: str) -> Iterator[str]:
    """The commands of a shell block, without comments."""
    for line in text.replace("\\\n", " ").splitlines():
        command = re.sub(r"(^|\s)#.*", "", line).strip()
        if command:
            yield command


def run_line(line: str, block: Block, *, until: str | None) -> None:
    words = shlex.split(line)
    if until is not None:
        interrupt(line, block, until)
    elif words[0] == "holdfast" and not SHELL_SYMBOLS.search(line):
        code = main(words[1:])
        assert code == 0, f"{block.location}: {line!r} ended with {code}"
    else:
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", line], env=environment(), check=False,
            capture_output=True, text=True, timeout=PATIENCE,
        )  # fmt: skip
        print(done.stdout, done.stderr, sep="", end="")  # noqa: T201
        assert done.returncode == 0, f"{block.location}: {line!r}: {done.stderr}"


def interrupt(line: str, block: Block, until: str) -> None:
    """Run a command until it prints a text, then interrupt it as Ctrl-C does.

    An earlier interrupt could come while modules are imported, and be lost there.
    """
    process = subprocess.Popen(
        ["bash", "-c", f"exec env {line}"], env=environment(), text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    try:
        first = ""
        for line_of_it in process.stderr:
            first += line_of_it
            if until in line_of_it:
                break
        os.killpg(process.pid, signal.SIGINT)
        _, rest = process.communicate(timeout=PATIENCE)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert first, f"{block.location}: {line!r} printed nothing"
    errors = [text for text in (first + rest).splitlines() if text.startswith("holdfast: ")]
    assert set(errors) <= {"holdfast: interrupted"}, f"{block.location}: {line!r}: {errors}"
    assert process.returncode in (0, 130), f"{block.location}: {line!r}: {first}{rest}"


def environment() -> dict[str, str]:
    return {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}


def check_options(block: Block) -> None:
    """Check that the verbs and options of commands that do not run exist."""
    if block.language != "sh":
        return
    for line in lines_of(block.text):
        for part in re.split(r"[|&;]+", line):
            words = [word for word in shlex.split(part) if word not in ("uv", "run")]
            if words and Path(words[0]).name == "holdfast":
                two = " ".join(words[1:3])
                verb = two if two in app.SUB_VERBS else words[1]
                with redirect_stdout(io.StringIO()) as out:
                    assert main([*verb.split(), "--help-all"]) == 0, f"{block.location}: {line}"
                flags = {word.partition("=")[0] for word in words if word.startswith("--")}
                unknown = flags - set(re.findall(r"--[\w-]+", out.getvalue()))
                assert not unknown, f"{block.location}: {line}: {unknown}"
