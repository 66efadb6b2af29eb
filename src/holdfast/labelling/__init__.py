"""Labels: proposed by rules, drawn by people, reviewed, exchanged with other programs."""

import importlib
import sys
import warnings
from types import ModuleType

_MOVED_MODULES = {
    "changes": "server.signals",
    "doubt": "review.spans",
    "page_schema": "server.schema",
    "poses": "rules.poses",
}
"""Modules that the documentation of an earlier release named, and where their content is now."""


class _MovedModule(ModuleType):
    """Module under its old name: returns attributes of the new one with a deprecation warning."""

    def __init__(self, old: str, new: str) -> None:
        super().__init__(f"{__name__}.{old}")
        self._new = f"{__name__}.{new}"

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        text = f"{self.__name__} is deprecated; use {self._new}"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(self._new), name)


for _old, _new in _MOVED_MODULES.items():
    sys.modules.setdefault(f"{__name__}.{_old}", _MovedModule(_old, _new))
