"""Imports of numba and matplotlib that ignore their settings in the working folder.

A folder of recordings may come from anybody. numba unpickles what is in the `cache_dir` of a file
`.numba_config.yaml` there, and matplotlib runs LaTeX if a `matplotlibrc` there says so.
"""

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

SETTINGS_FILES = (".numba_config.yaml", "matplotlibrc")
"""Names that both look up in the working folder, by these relative paths."""
_READERS = ("numba.core.config", "matplotlib")
"""Modules that read these files while they are imported."""


def ignore_settings_of_folder() -> None:
    """Ignore the settings in the working folder in all later imports of this process."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
    config: Any = sys.modules.get("numba.core.config")
    if getattr(config, "_config_fname", ""):  # imported by the caller
        _forget_file(config)
        config.reload_config()  # without the file: its settings become those of the environment


class _Finder:
    """Finder of the two modules, whose loaders do not see the files."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in _READERS:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            loader: Any = spec.loader
            execute = loader.exec_module
            loader.exec_module = lambda module: _execute_without_files(execute, module)
        return spec


def _execute_without_files(execute: Any, module: ModuleType) -> None:  # noqa: ANN401
    """Execute a module for which the files do not exist.

    Both ask `os.path.exists` first. Other threads meanwhile get the same answers as ever, unless
    they ask for one of these two relative paths.
    """
    exists = os.path.exists
    os.path.exists = lambda path: path not in SETTINGS_FILES and exists(path)
    try:
        execute(module)
    finally:
        os.path.exists = exists
    _forget_file(module)


def _forget_file(module: Any) -> None:  # noqa: ANN401
    """Keep numba from reading the file again, as it does at each compilation."""
    if hasattr(module, "_config_fname"):
        module._config_fname = ""
