"""The extension module of the kernel, which tests of the binding call directly."""

from holdfast.kernel import _extension as extension

__all__ = ["extension"]
