"""Randomized hands: sensors, grippers, objects and arm motions drawn from wide ranges."""
