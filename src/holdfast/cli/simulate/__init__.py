"""The verb `holdfast simulate`, and the options of its grasps."""

from holdfast.cli.simulate.options import GraspOptions
from holdfast.cli.simulate.verb import simulate

__all__ = ["GraspOptions", "simulate"]
