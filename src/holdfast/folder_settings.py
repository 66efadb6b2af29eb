"""An import of matplotlib that ignores its settings in the working folder.

A folder of recordings may come from anybody, and matplotlib runs LaTeX if a `matplotlibrc` there
says so.
"""

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

SETTINGS_FILE = "matplotlibrc"
"""Name that matplotlib looks up in the working folder, by this relative path, when imported."""


def ignore_settings_of_folder() -> None:
    """Ignore the settings in the working folder in all later imports of this process."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        # First, as the finders of Python would find matplotlib before it.
        sys.meta_path.insert(0, _Finder())


class _Finder:
    """Finder of matplotlib, whose loader does not see the file."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != "matplotlib":
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            loader: Any = spec.loader
            execute = loader.exec_module
            loader.exec_module = lambda module: _execute_without_file(execute, module)
        return spec


def _execute_without_file(execute: Any, module: ModuleType) -> None:  # noqa: ANN401
    """Execute a module for which the file does not exist.

    It asks `os.path.exists` first. Other threads meanwhile get the same answers as ever, unless
    they ask for this relative path.
    """
    exists = os.path.exists
    os.path.exists = lambda path: path != SETTINGS_FILE and exists(path)
    try:
        execute(module)
    finally:
        os.path.exists = exists
