"""Simulation of the experiment: deterministic physics from a seed, without a clock."""

from holdfast.kernel import checked

checked("holdfast.twin.steps", "the steps of the twin in C")
