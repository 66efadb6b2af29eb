"""The program of each figure is here or at a named commit."""

import re
import subprocess

from . import blocks

PROGRAM = re.compile(
    r"((?:benchmarks|lab/holdfast_lab)/[\w/]+\.(?:py|sh|awk))(?:[^`\n]*(?:`| #) at commit (\w+))?"
)


def test_a_program_that_a_page_names_is_here_or_was_at_the_commit_it_names():
    texts = [page.read_text("utf-8") for page in (blocks.ROOT / "docs").rglob("*.md*")]
    named = {tuple(found) for text in texts for found in PROGRAM.findall(text)}
    gone = {(path, commit) for path, commit in named if not (blocks.ROOT / path).is_file()}
    assert len(named) > len(gone) > 10
    assert [path for path, commit in gone if not commit] == []
    for path, commit in gone:
        git = ["git", "-C", str(blocks.ROOT), "cat-file", "-e"]
        if subprocess.run([*git, commit], capture_output=True, check=False).returncode == 0:
            subprocess.run([*git, f"{commit}:{path}"], check=True)  # else the clone has no history
