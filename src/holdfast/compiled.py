"""Compilation of kernels: once, cached on disk, by the rules of IEEE arithmetic.

There is no fast-math, so a result does not depend on how many samples are computed at a time.
The cache does not follow imports: after a change of a kernel, delete it (see CONTRIBUTING).
"""

import numba

compiled = numba.njit(cache=True, error_model="numpy")
compiled_parallel = numba.njit(cache=True, error_model="numpy", parallel=True)
compiled_inside = numba.njit(cache=True, error_model="numpy", forceinline=True)
"""Compile a step into the loops that call it: a call costs as much as the step."""
inlined = numba.njit(error_model="numpy", inline="always")
"""Inline a step that receives all arrays: passing them costs as much as the step."""
