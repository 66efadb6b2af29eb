"""The ways to count glitches of the hand's controller in tables of events.

The paper counts the detection of a glitch as a success. For a user it is a false alarm, because
nothing but the hand itself moved the object. So every table of events has both readings. In a
third one glitches are left out.
"""

from typing import NamedTuple

import numpy as np

from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures

EVENT = "an event"
FALSE_ALARM = "a false alarm"
LEFT_OUT_SPLIT = "left out"
READINGS = (EVENT, FALSE_ALARM, LEFT_OUT_SPLIT)
"""Readings by the words that stand for them in tables, under "a glitch is"."""


class HandLabels(NamedTuple):
    """Labels of the hand under one reading of glitches.

    Attributes:
        labels: (n,) label codes.
        glitch: (n,) samples at which a glitch is the only reason not to be stable.
        without_glitches: whether alarms of glitches are left out.
    """

    labels: Codes
    glitch: Mask
    without_glitches: bool


def labels_by_reading(recording: RecordingFeatures) -> dict[str, HandLabels]:
    """Return the exact labels of the hand for each of `READINGS`."""
    unstable = recording.hand_labels(recording.exact_labels).labels
    stable = recording.hand_labels(recording.labels_without_glitches()).labels
    glitch = np.asarray(unstable != stable)
    return {
        EVENT: HandLabels(unstable, glitch, without_glitches=False),
        FALSE_ALARM: HandLabels(stable, glitch, without_glitches=False),
        LEFT_OUT_SPLIT: HandLabels(stable, glitch, without_glitches=True),
    }
