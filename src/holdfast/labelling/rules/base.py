"""From a state at every instant to labels with their evidence and confidence."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import UNKNOWN, Cause, ContactState
from holdfast.metrics.masks import Mask
from holdfast.recordings import Label
from holdfast.sensors.types import Array

SHORT = 0.2
"""Duration at which a label keeps 63 % of its confidence [s]."""

WEAKEST = 0.25
"""Share of a label's time that its evidence is judged by: the time where that is weakest."""

_CAUSES = (None, *Cause)
_STATES = tuple(ContactState)

Evidence = Callable[[ContactState, Cause | None, float], str]
"""What a label rests on, from its state, its cause, and how many times over its threshold."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a rule says of one finger, instant by instant; it is drawn over, like a picture.

    Attributes:
        times: (n,) a sample period apart [s].
        codes: (n,) of the state; UNKNOWN where there is no label.
        causes: (n,) place of the cause, 0 for none.
        ratio: (n,) how many times the evidence is over (or under) its threshold; 1 at it.
    """

    times: Array
    codes: npt.NDArray[np.int8]
    causes: npt.NDArray[np.int8]
    ratio: Array

    @classmethod
    def blank(cls, times: Array) -> Self:
        """No label anywhere."""
        codes = np.full(len(times), UNKNOWN, dtype=np.int8)
        return cls(times, codes, np.zeros(len(times), dtype=np.int8), np.ones(len(times)))

    def paint(
        self, mask: Mask, state: int, cause: Cause | None = None, ratio: Array | float = 1.0
    ) -> None:
        """Sets state, cause and evidence where the mask is."""
        self.codes[mask] = state
        self.causes[mask] = _CAUSES.index(cause)
        self.ratio[mask] = np.broadcast_to(ratio, mask.shape)[mask]

    def recause(self, mask: Mask, cause: Cause) -> None:
        """Sets another cause where the mask is."""
        self.causes[mask] = _CAUSES.index(cause)


@dataclass(frozen=True)
class Pen:
    """How a rule signs its labels.

    Attributes:
        author: the rule.
        evidence: what a label rests on.
        trust: by which every confidence is multiplied.
        note: after the evidence of every label.
    """

    author: str
    evidence: Evidence
    trust: float = 1.0
    note: str = ""

    def labels(self, drawing: Drawing, span: tuple[float, float]) -> tuple[Label, ...]:
        """The intervals of equal state and cause, cut to the span of the module [s]."""
        times, found = drawing.times, []
        change = (np.diff(drawing.codes) != 0) | (np.diff(drawing.causes) != 0)
        edges = np.concatenate([[0], np.flatnonzero(change) + 1, [len(times)]])
        ends = np.append(times, np.inf)
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            start, end = max(float(times[first]), span[0]), min(float(ends[last]), span[1])
            if drawing.codes[first] != UNKNOWN and start < end:
                found.append(self._label(drawing, slice(first, last), start, end))
        return tuple(found)

    def _label(self, drawing: Drawing, part: slice, start: float, end: float) -> Label:
        state = _STATES[drawing.codes[part.start]]
        cause = _CAUSES[drawing.causes[part.start]]
        ratio = max(float(np.quantile(drawing.ratio[part], WEAKEST)), 1.0)
        confidence = self.trust * certainty(ratio, end - start)
        text = self.evidence(state, cause, ratio) + (f"; {self.note}" if self.note else "")
        return Label(start, end, state, cause, text, round(confidence, 3), self.author)


def certainty(ratio: float, duration: float) -> float:
    """From 0 to 1: how far the evidence is from its threshold, over how long a time.

    At the threshold it is a half, at twice the threshold three quarters, at ten times 0.95;
    times 1 - exp(-duration / SHORT), which takes nothing from a label of a second.

    Args:
        ratio: how many times over (or under) its threshold the evidence is.
        duration: of the label [s].

    Example:
        >>> round(certainty(2.0, 10.0), 2), round(certainty(10.0, 10.0), 2)
        (0.75, 0.95)
    """
    return float((1 - 0.5 / max(ratio, 1.0)) * (1 - np.exp(-duration / SHORT)))


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
