"""How kernels are compiled: once, kept on disk, by the rules of IEEE arithmetic.

No fast-math: a result does not depend on how many samples are computed at a time. The cache
does not follow imports: who edits a kernel deletes it (CONTRIBUTING tells how).
"""

import numba

compiled = numba.njit(cache=True, error_model="numpy")
compiled_parallel = numba.njit(cache=True, error_model="numpy", parallel=True)
inlined = numba.njit(error_model="numpy", inline="always")
"""For steps that take all arrays: handing them over costs as much as the step."""
