"""What is changed in recordings before they train or test: noise, rate, the margin of labels."""

import zlib
from dataclasses import replace

import msgspec
import numpy as np

from holdfast.recordings import Recording, Tactile
from holdfast.twin.labels import LabelRule, labels_from_truth


class Variation(msgspec.Struct, frozen=True):
    """How recordings are changed; nothing is, by default.

    Attributes:
        noise: standard deviation of white noise that every reading gets [unit of the readings];
            counts stay whole.
        every: only every n-th sample is taken: a slower sensor of the same kind.
        margin: by which labels out of the truth draw disturbances longer at both ends [s]; None
            for the labels as they are.
    """

    noise: float = 0.0
    every: int = 1
    margin: float | None = None

    def apply(self, recording: Recording) -> Recording:
        """The recording, changed; the same whenever it is asked for."""
        if self.margin is not None:
            recording = relabelled(recording, self.margin)
        if self == Variation(margin=self.margin):
            return recording
        seed = zlib.crc32(recording.name.encode())
        modules = {
            name: self._module(module, np.random.default_rng([seed, place]))
            for place, (name, module) in enumerate(recording.modules.items())
        }
        return replace(recording, modules=modules)

    def _module(self, module: Tactile, generator: np.random.Generator) -> Tactile:
        readings = np.asarray(module.readings, dtype=np.float64)
        if self.noise:
            readings = readings + generator.normal(0.0, self.noise, size=readings.shape)
            readings = np.rint(readings) if module.unit == "count" else readings
        return replace(
            module,
            times=module.times[:: self.every],
            readings=readings[:: self.every],
            sensor=replace(module.sensor, rate=module.sensor.rate / self.every),
        )


def relabelled(recording: Recording, margin: float) -> Recording:
    """The recording with labels out of its truth; as it is, where it has none."""
    truth = recording.truth
    if truth is None or not {"phase", "outside_force"} <= set(truth.hand):
        return recording
    rule = LabelRule(margin=margin)
    modules = {
        name: replace(module, labels=labels_from_truth(truth, name, rule))
        if {"contact_force", "slip_speed"} <= set(truth.fingers.get(name, ()))
        else module
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)
