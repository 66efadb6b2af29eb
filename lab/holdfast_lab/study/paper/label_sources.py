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
from holdfast.recordings import Label, Recording, Tactile, Truth, label_states, labels_from_samples
from holdfast_lab.study.methods import hand_signal
from holdfast_lab.study.methods.wavelets import detail_energy

LabelSource = Literal["recording", "exact", "drawn", "sliding", "no_glitches", "own_energy"]
"""Where labels come from.

`recording`: those of the recording. `exact`: from the truth without margin. `drawn`: by the rule
`signal` from the force alone. `sliding`: from the truth, but in a held contact only sliding is
unstable; disturbances without sliding and glitches are stable. `no_glitches`: from the truth, but
a glitch of the hand's controller is stable. `own_energy`: by a threshold on the energy of the Haar
details of the normal force, which is nearly a feature of the classifier.
"""
OWN_ENERGY, OWN_FORCE, OWN_WINDOW = 4400.0, 60.0, 4
"""Energy [count^2] from which on a contact is labelled unstable, normal force [count] from which on
there is a contact, and N_w, of the public prototype of the paper's first author
(github.com/Douniakit/tactile_data)."""


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
    if source == "own_energy":
        return recording.with_labels(own_energy_labels(recording, tare))
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


def own_energy_labels(recording: Recording, tare: str) -> dict[str, tuple[Label, ...]]:
    """Return labels of each finger by the energy of the details of its normal force."""
    labels = {}
    for name, finger in hand_signal(recording, Tare.parse(tare)).fingers.items():
        energy = np.full(len(finger.times), np.nan)
        for rows in finger.stretches:
            energy[rows] = detail_energy(finger.normal_force[rows], OWN_WINDOW)
        states: list[tuple[ContactState, Cause | None] | None] = []
        for value, force in zip(energy, finger.normal_magnitude, strict=True):
            if np.isnan(value):
                states.append(None)
            elif force <= OWN_FORCE:
                states.append((ContactState.NO_CONTACT, None))
            else:
                stable = value < OWN_ENERGY
                states.append((ContactState.STABLE if stable else ContactState.UNSTABLE, None))
        period = recording.modules[name].period
        labels[name] = labels_from_samples(
            finger.times, states, period=period, evidence="force", author="energy"
        )
    return labels


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
