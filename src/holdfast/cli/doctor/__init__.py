"""The verb `holdfast doctor`, and what it says of the installation."""

from holdfast.cli.doctor.verb import doctor

__all__ = ["doctor"]
