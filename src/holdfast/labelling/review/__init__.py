"""Review of recordings and labels: findings, content, labels of low confidence."""

from holdfast.labelling.review.confidence import doubtful

__all__ = ["doubtful"]
