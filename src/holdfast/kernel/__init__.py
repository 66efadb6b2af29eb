"""The arithmetic of a sample in C, and its extension module (decision 29).

Nothing is compiled at import. In a clone, an extension that was built from other sources than
those beside it is refused: its numbers would not be those of the code that one reads.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from holdfast.errors import DISTRIBUTION, HoldfastError
from holdfast.kernel.sources import digest

_BUILD = f"uv sync --inexact --reinstall-package {DISTRIBUTION}, or pip install -e ."
_PACKAGE = Path(__file__).parents[1]
# A wheel has no module.c, so nothing is compared there.
_SOURCES = digest(_PACKAGE) if (_PACKAGE / "kernel" / "module.c").exists() else None


def checked(name: str, title: str) -> ModuleType:
    """Import an extension module of the package, which was built from the sources beside it.

    Args:
        name: name of the module.
        title: what it is, for messages.

    Raises:
        HoldfastError: it was not built, or was built from other sources.
    """
    try:
        module = import_module(name)
    except ImportError as error:
        raise HoldfastError(f"{title} cannot be loaded ({error}); build it: {_BUILD}") from error
    if _SOURCES not in (None, module.SOURCES):
        raise HoldfastError(f"{title} was built from other sources; build it again: {_BUILD}")
    return module


checked("holdfast.kernel._extension", "the C kernel")
