"""The arithmetic of a sample in C, and its extension module (decision 29).

Nothing is compiled at import. In a clone, an extension that was built from other sources than
those beside it is refused: its numbers would not be those of the code that one reads.
"""

from pathlib import Path

from holdfast.errors import HoldfastError
from holdfast.kernel.sources import digest

_BUILD = "uv sync --inexact --reinstall-package holdfast, or pip install -e ."
_FOLDER = Path(__file__).parent

try:
    from holdfast.kernel import _extension
except ImportError as error:
    raise HoldfastError(f"the C kernel cannot be loaded ({error}); build it: {_BUILD}") from error
# A wheel has no module.c, so nothing is compared there.
if (_FOLDER / "module.c").exists() and digest(_FOLDER) != _extension.SOURCES:
    raise HoldfastError(f"the C kernel was built from other sources; build it again: {_BUILD}")
