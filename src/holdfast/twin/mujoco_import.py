"""MuJoCo, imported without code of the working folder and with a back end for pictures.

MuJoCo imports glfw, which looks for the version of its library in child processes of Python.
While it is imported it chooses its back end for pictures, by an environment variable.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from os import environ

from holdfast.children import safe_path


def _default_back_end() -> str:
    """Return the name of the back end that most likely works without a display."""
    if sys.platform == "darwin":
        return "cgl"
    if sys.platform == "win32" or "mujoco" in sys.modules:  # imported before, without a choice
        return "glfw"
    if find_library("EGL") is not None:
        return "egl"
    return "disable" if find_library("OSMesa") is None else "osmesa"


@contextmanager
def _back_end_variable(name: str) -> Iterator[None]:
    """Set the variable that MuJoCo reads; set it back, and the one that MuJoCo sets."""
    before = {key: environ.get(key) for key in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    environ["MUJOCO_GL"] = name
    try:
        yield
    finally:
        for key, value in before.items():
            environ.pop(key, None)
            if value is not None:
                environ[key] = value


BACK_END = environ.get("MUJOCO_GL", "").lower().strip() or _default_back_end()
"""Name of MuJoCo's back end for pictures."""

with safe_path, _back_end_variable(BACK_END):
    import mujoco

__all__ = ["BACK_END", "mujoco"]
