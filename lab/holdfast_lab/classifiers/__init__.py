"""Classifiers of the study that the product does not use."""
