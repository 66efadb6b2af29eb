"""Checks of what a rule is given."""

import math
from dataclasses import fields
from typing import Any


def check_positive(rule: Any) -> None:  # noqa: ANN401 (any dataclass)
    """Refuses a limit that is not a number above 0; text is not looked at.

    Raises:
        ValueError: one is not.
    """
    for field in fields(rule):
        value = getattr(rule, field.name)
        if isinstance(value, str):
            continue
        if not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
            raise ValueError(f"{field.name}: a number above 0 expected, {value!r} given")
