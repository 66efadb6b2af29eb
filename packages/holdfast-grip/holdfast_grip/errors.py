"""The exception of hands."""

from holdfast.errors import HoldfastError


class HandError(HoldfastError):
    """A hand cannot be commanded: see that it is left in a safe state, then repair it."""
