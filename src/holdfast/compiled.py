"""Compilation of kernels: once, cached on disk, by the rules of IEEE arithmetic.

There is no fast-math, so a result does not depend on how many samples are computed at a time.
The cache does not follow imports: after a change of a kernel, delete it (see CONTRIBUTING).
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import event
from numba.core.cpu import CPUTargetOptions

from holdfast.compile_notice import COMPILE_LOGGER, COMPILING

Function = TypeVar("Function", bound=Callable[..., Any])


class _CompilationLog(event.Listener):
    """Listener that logs each compilation; a kernel from the cache is none."""

    def on_start(self, _: event.Event) -> None:
        COMPILE_LOGGER.info(COMPILING)

    def on_end(self, _: event.Event) -> None:
        """Do nothing."""


event.register("numba:compile", _CompilationLog())  # type: ignore[no-untyped-call]

compiled = numba.njit(cache=True, error_model="numpy")
compiled_inside = numba.njit(cache=True, error_model="numpy", forceinline=True)
"""Compile a step into the loops that call it: a call costs as much as the step."""
inlined = numba.njit(error_model="numpy", inline="always")
"""Inline a step that receives all arrays: passing them costs as much as the step."""


def sums_in_any_order(function: Function) -> Function:
    """Mark a step, or a part of one, whose sums over taxels C may take in any order.

    In C, neighbouring taxels are next to each other in memory, and their sums are computed several
    taxels at a time. All numbers of such a step must be finite. In Python the order is that of the
    source, so that the bits are the same on every machine.
    """
    function.sums_in_any_order = True  # type: ignore[attr-defined]
    return function


COUNTS_ARE_OPTIONAL = hasattr(CPUTargetOptions, "_nrt")
"""Whether numba has its option for reference counts, which is not public. Without it, steps give
the same, and take half as long again."""


def compiled_step(function: Function) -> Function:
    """Compile a step that allocates no array and returns none, without reference counts.

    Otherwise numba counts each use of each array, which takes longer than the arithmetic. Copy
    arrays element by element in such a step: a slice assigned to a slice allocates.
    """
    return _compile(function, counts=False)


def joined_step(function: Function) -> Function:
    """Compile a step that becomes part of the steps that call it.

    By itself the compiler joins short steps only, and a call that passes arrays costs 10 to 300 ns.
    """
    return _compile(function, counts=False, joined=True)


def compiled_view(function: Function) -> Function:
    """Compile a function that returns an array, for use in a step without reference counts."""
    return _compile(function, counts=True)


def _compile(function: Function, *, counts: bool, joined: bool = False) -> Function:
    options: dict[str, Any] = {"forceinline": joined}
    if COUNTS_ARE_OPTIONAL:
        options["_nrt"] = counts
    compile_it: Any = numba.njit(cache=True, error_model="numpy", **options)
    return cast("Function", compile_it(function))
