"""Simulation of the experiment: deterministic physics from a seed, without a clock."""
