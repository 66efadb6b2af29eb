"""Review of labels: audit by a classifier, comparison of two sets of labels, low confidence."""

from holdfast.labelling.review.spans import doubtful

__all__ = ["doubtful"]
