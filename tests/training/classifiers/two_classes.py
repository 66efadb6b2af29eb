"""Samples of two classes that overlap, for the solvers of linear classifiers."""

import numpy as np

from holdfast.training.classifiers.fitting import standardise


def samples(n=600, d=5, shift=1.0, share=0.5, seed=0):
    """(n, d) standardised features, and (n,) classes whose means are `shift` apart."""
    draw = np.random.default_rng(seed)
    stable = draw.random(n) < share
    features = draw.normal(size=(n, d)) @ draw.normal(size=(d, d))
    features += shift * stable[:, None] * draw.normal(size=d)
    return standardise(features)[2], stable
