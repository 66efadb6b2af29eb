"""Labels of the same recordings by other conventions: exact, as a person draws them, sliding only.

A person draws labels from the plot of the force; the rule `signal` does it in the same way.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from holdfast.contact import HELD_PHASES, SLIP_SPEED, UNSTABLE, Cause, ContactState
from holdfast.features import Tare
from holdfast.labelling.rules import signal
from holdfast.metrics.masks import Mask
from holdfast.metrics.truth_labels import LabelRule, fingers_with_truth, relabel
from holdfast.recordings import Recording, Tactile, Truth, label_states, labels_from_samples

LabelSource = Literal["recording", "exact", "drawn", "sliding", "no_glitches"]
"""Where labels come from.

`recording`: those of the recording. `exact`: from the truth without margin. `drawn`: by the rule
`signal` from the force alone. `sliding`: from the truth, but in a held contact only sliding is
unstable; disturbances without sliding and glitches are stable. `no_glitches`: from the truth, but
a glitch of the hand's controller is stable.
"""


def has_truth(recording: Recording) -> bool:
    """Return whether exact labels can be made for all fingers of a recording."""
    return len(fingers_with_truth(recording)) == len(recording.modules)


def relabelled(recording: Recording, source: LabelSource, tare: str) -> Recording:
    """Return the recording with labels from another source.

    Without a truth, all but `drawn` keep the labels of the recording.

    Args:
        recording: to label.
        source: of the labels.
        tare: how the baseline is found, for labels from the force.
    """
    if source == "drawn":
        return recording.with_labels(signal.propose(recording, Tare.parse(tare)))
    truth = recording.truth
    if source == "recording" or truth is None or not has_truth(recording):
        return recording
    if source == "no_glitches":
        return relabel(recording, LabelRule(margin=0.0, glitch=None))
    exact = relabel(recording, LabelRule(margin=0.0))
    if source == "exact":
        return exact
    modules = {name: _only_sliding(module, truth, name) for name, module in exact.modules.items()}
    return replace(exact, modules=modules)


def _only_sliding(module: Tactile, truth: Truth, finger: str) -> Tactile:
    """Return a module in which a held contact is unstable only while it slides."""
    grasped, sliding = grasped_and_sliding(truth, finger)
    at_sample = np.clip(
        np.searchsorted(truth.times, module.times, side="right") - 1, 0, len(truth.times) - 1
    )
    quiet = (grasped & ~sliding)[at_sample] & (
        label_states(module.labels, module.times) == UNSTABLE
    )
    # Labels are in order of time, so one pass over both is enough.
    labels = iter(module.labels)
    label = next(labels, None)
    states: list[tuple[ContactState, Cause | None] | None] = []
    for time, is_quiet in zip(module.times.tolist(), quiet.tolist(), strict=True):
        while label is not None and time >= label.end:
            label = next(labels, None)
        known = label is not None and label.start <= time
        if is_quiet:
            states.append((ContactState.STABLE, None))
        else:
            states.append((label.state, label.cause) if known and label is not None else None)
    made = labels_from_samples(
        module.times, states, period=module.period, evidence="truth", author="twin"
    )
    return replace(module, labels=made)


def grasped_and_sliding(truth: Truth, finger: str) -> tuple[Mask, Mask]:
    """Return (n,) where the hand holds the object, and where it slides on the finger."""
    grasped = np.isin(truth.hand["phase"], HELD_PHASES)
    return np.asarray(grasped), np.asarray(
        grasped & (truth.fingers[finger]["slip_speed"] > SLIP_SPEED)
    )
