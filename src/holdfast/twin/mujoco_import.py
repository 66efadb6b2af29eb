"""MuJoCo, imported without its back end for pictures, which would start child processes."""

from os import environ

before = environ.get("MUJOCO_GL")
environ["MUJOCO_GL"] = before or "disable"
try:
    import mujoco
finally:
    if before is None:
        del environ["MUJOCO_GL"]

__all__ = ["mujoco"]
