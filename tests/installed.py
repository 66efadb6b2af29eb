"""Packages with entry points that a test installs into a folder, as pip does."""

import shutil
import sys
import tomllib
from contextlib import contextmanager
from pathlib import Path


def install(folder: Path, name: str, files: dict[str, str], points: dict[str, dict[str, str]]):
    """Write a package: its modules, and the metadata that an installer writes."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    info = folder / f"{name.replace('-', '_')}-1.2.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    lines = [
        line
        for kind, targets in points.items()
        for line in (f"[{kind}]", *(f"{key} = {target}" for key, target in targets.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines))


def install_project(folder: Path, project: Path) -> None:
    """Install a project folder: the packages in it, with the entry points of its pyproject."""
    described = tomllib.loads((project / "pyproject.toml").read_text("utf-8"))["project"]
    for package in project.glob("*/__init__.py"):
        shutil.copytree(package.parent, folder / package.parent.name)
    install(folder, described["name"], {}, described["entry-points"])


@contextmanager
def on_the_path(folder: Path, monkeypatch):
    """Let packages in a folder be found; forget them afterwards."""
    before = set(sys.modules)
    with monkeypatch.context() as patch:
        patch.syspath_prepend(folder)
        yield
    for name in set(sys.modules) - before:
        if str(folder) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
