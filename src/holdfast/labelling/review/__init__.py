"""Review of labels: audit by a classifier, comparison of two labellings, low confidence."""

from holdfast.labelling.review.spans import doubtful

__all__ = ["doubtful"]
