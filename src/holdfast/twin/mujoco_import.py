"""MuJoCo, imported without code of the working folder.

MuJoCo imports glfw, which looks for the version of its library in child processes of Python.
"""

from holdfast.children import safe_path

with safe_path:
    import mujoco

__all__ = ["mujoco"]
