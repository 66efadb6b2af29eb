"""Rules that propose labels from evidence, for a person to check."""

from holdfast.labelling.rules.registry import RULES, propose

__all__ = ["RULES", "propose"]
