"""Variations of recordings before training and testing: noise, sampling rate, label margin."""

import zlib
from dataclasses import replace

import msgspec
import numpy as np

from holdfast.metrics.truth_labels import LabelRule, relabel
from holdfast.recordings import Recording, Tactile


class Variation(msgspec.Struct, frozen=True):
    """A variation of recordings. The default changes nothing.

    Attributes:
        noise: standard deviation of white noise added to every reading [unit of the readings].
            Counts stay integers.
        every: keep only every n-th sample, as a slower sensor of the same kind gives them.
        margin: time by which labels made from the truth extend disturbances at both ends [s].
            None keeps the labels of the recording.
    """

    noise: float = 0.0
    every: int = 1
    margin: float | None = None

    def apply(self, recording: Recording) -> Recording:
        """Return the varied recording. The same recording always gets the same noise."""
        if self.margin is not None:
            recording = relabel(recording, LabelRule(margin=self.margin))
        if self == Variation(margin=self.margin):
            return recording
        seed = zlib.crc32(recording.name.encode())
        modules = {
            name: self._vary_module(module, np.random.default_rng([seed, place]))
            for place, (name, module) in enumerate(recording.modules.items())
        }
        return replace(recording, modules=modules)

    def _vary_module(self, module: Tactile, generator: np.random.Generator) -> Tactile:
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
