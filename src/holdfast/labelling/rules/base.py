"""Parts that all rules share: states over time, the labels made from them, checks of parameters."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import UNKNOWN, Cause, ContactState
from holdfast.detection.traces import CAUSE_BY_CODE, STATE_BY_CODE
from holdfast.metrics.masks import Mask
from holdfast.recordings import Label
from holdfast.sensors.types import Array

MAX_NUMBER = 1e9
"""Largest number of a threshold; above, a number of samples does not fit into 64 bits."""
CONFIDENCE_TIME = 0.2
"""Duration at which a label keeps 63 % of its confidence [s]."""

EVIDENCE_QUANTILE = 0.25
"""Quantile of the evidence within a label that its confidence rests on."""

MAX_RATIO = 200.0
"""Largest evidence ratio, of a confidence of 0.998. A ratio over a threshold of 0 is this one."""

EvidenceText = Callable[[ContactState, Cause | None, float], str]
"""Function that returns the evidence of a label from its state, cause and evidence ratio."""


@dataclass(frozen=True, eq=False)
class StateTimeline:
    """State, cause and evidence of one finger at every instant. Later settings replace earlier.

    The evidence ratio is the measured quantity over its threshold (or the threshold over the
    quantity, for states below it): 1 at the threshold, larger for clearer evidence.

    Attributes:
        times: (n,) on a regular grid [s].
        codes: (n,) of the states; UNKNOWN where there is no label.
        causes: (n,) index of the causes, 0 for none.
        ratio: (n,) evidence ratios.
    """

    times: Array
    codes: npt.NDArray[np.int8]
    causes: npt.NDArray[np.int8]
    ratio: Array

    @classmethod
    def unknown(cls, times: Array) -> Self:
        """Return a timeline without any label."""
        codes = np.full(len(times), UNKNOWN, dtype=np.int8)
        return cls(times, codes, np.zeros(len(times), dtype=np.int8), np.ones(len(times)))

    def set_state(
        self, mask: Mask, state: int, cause: Cause | None = None, ratio: Array | float = 1.0
    ) -> None:
        """Set the state, cause and evidence ratio where the mask is True."""
        self.codes[mask] = state
        self.causes[mask] = CAUSE_BY_CODE.index(cause)
        self.ratio[mask] = np.broadcast_to(ratio, mask.shape)[mask]

    def set_cause(self, mask: Mask, cause: Cause) -> None:
        """Set only the cause where the mask is True."""
        self.causes[mask] = CAUSE_BY_CODE.index(cause)


@dataclass(frozen=True)
class LabelWriter:
    """Maker of labels from a timeline, with the author and evidence of a rule.

    Attributes:
        author: name of the rule.
        evidence: returns the evidence text of a label.
        trust: factor on every confidence, from 0 to 1.
        note: text after the evidence of every label.
    """

    author: str
    evidence: EvidenceText
    trust: float = 1.0
    note: str = ""

    def labels(self, timeline: StateTimeline, span: tuple[float, float]) -> tuple[Label, ...]:
        """Return intervals of equal state and cause, cut to the span of the module [s]."""
        times, labels = timeline.times, []
        change = (np.diff(timeline.codes) != 0) | (np.diff(timeline.causes) != 0)
        edges = np.concatenate([[0], np.flatnonzero(change) + 1, [len(times)]])
        ends = np.append(times, np.inf)  # the last label goes to the end of the span
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            start, end = max(float(times[first]), span[0]), min(float(ends[last]), span[1])
            if timeline.codes[first] != UNKNOWN and start < end:
                state = STATE_BY_CODE[timeline.codes[first]]
                cause = CAUSE_BY_CODE[timeline.causes[first]]
                # A label is as sure as its weaker parts, but single samples do not count: noise
                # takes some of them to the threshold. Margins lie below it, and are not denied.
                weak = float(np.quantile(timeline.ratio[first:last], EVIDENCE_QUANTILE))
                ratio = max(weak, 1.0)
                confidence = self.trust * label_confidence(ratio, end - start)
                text = self.evidence(state, cause, ratio) + (f"; {self.note}" if self.note else "")
                author = self.author
                label = Label(start, end, state, cause, text, round(confidence, 3), author)
                labels.append(label)
        return tuple(labels)


def evidence_ratio(quantity: npt.ArrayLike, threshold: npt.ArrayLike) -> Array:
    """Return a quantity over its threshold, from 1 / MAX_RATIO to MAX_RATIO.

    Both may be 0, where readings do not change. The ratio of two zeros is 1: no evidence.

    Args:
        quantity: (n,), at least 0.
        threshold: of the quantity, at least 0, in the same unit; (n,) or one for all.

    Example:
        >>> evidence_ratio([1.0, 3.0, 0.0], 2.0).tolist(), evidence_ratio([0.0, 3.0], 0.0).tolist()
        ([0.5, 1.5, 0.005], [1.0, 200.0])
    """
    values, least = np.broadcast_arrays(
        np.asarray(quantity, dtype=np.float64), np.asarray(threshold, dtype=np.float64)
    )
    ratio = np.where(values > 0, MAX_RATIO, 1.0)
    np.divide(values, least, out=ratio, where=least > values / MAX_RATIO)
    return np.clip(ratio, 1 / MAX_RATIO, MAX_RATIO)


def label_confidence(ratio: float, duration: float) -> float:
    """Return the confidence of a label, from 0 to 1.

        (1 - 0.5 / ratio) (1 - exp(-duration / CONFIDENCE_TIME))

    The first factor is 0.5 at the threshold, 0.75 at twice and 0.95 at ten times the threshold.
    The second factor is close to 1 for labels of a second or more.

    Args:
        ratio: evidence ratio.
        duration: of the label [s].

    Example:
        >>> round(label_confidence(2.0, 10.0), 2), round(label_confidence(10.0, 10.0), 2)
        (0.75, 0.95)
    """
    return float((1 - 0.5 / max(ratio, 1.0)) * (1 - np.exp(-duration / CONFIDENCE_TIME)))


def check_positive(parameters: Any) -> None:  # noqa: ANN401 (any dataclass)
    """Check that all fields of a dataclass are numbers above 0, up to `MAX_NUMBER`, or text.

    Raises:
        ValueError: a field is not.
    """
    for field in fields(parameters):
        value = getattr(parameters, field.name)
        if isinstance(value, str):
            continue
        if not (isinstance(value, int | float) and 0 < value <= MAX_NUMBER):
            raise ValueError(
                f"{field.name}: a number above 0 expected, up to {MAX_NUMBER:g}; {value!r} given"
            )
