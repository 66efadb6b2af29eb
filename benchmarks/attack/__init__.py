"""Attacks on holdfast, with counts: `python benchmarks/attack.py PART`."""
