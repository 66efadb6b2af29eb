"""Scan of a recording, read in parts, from which findings are made: all but its readings."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from holdfast.detection.plan import first_finite
from holdfast.io.importers.layout_findings import LayoutFinding, layout_findings
from holdfast.kernel.batch import fill_fingertip_force
from holdfast.live.readings_monitor import CHECK_INTERVAL, HoldDrift
from holdfast.recordings import Label, Recording, Tactile
from holdfast.resampling import HELD_ROWS, held_rows
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags

LAYOUT_SAMPLES = 20_000
"""Number of samples at the beginning that the findings about the layout are based on."""
SCAN_BLOCK_SAMPLES = 4096
"""Samples that are compared and summed at a time: bounds the memory."""


class ModuleScan:
    """Forces, repeats and ranges of a module, from all its samples: 33 bytes of each.

    Args:
        module: a part of it, which is not added.

    Attributes:
        sensor: of the module.
        labels: as in the recording; those that the parts divide are joined.
        still: (3,) whether no taxel changed along an axis.
        lowest: of all readings [unit of the readings].
        highest: of all readings [unit of the readings].
        rows_per_update: rows in which each sample comes, in the first part; 1 if in one.
        layout: findings about the layout of the readings, in the first part.
    """

    def __init__(self, module: Tactile) -> None:
        self.sensor = module.sensor
        self.labels: list[Label] = []
        self.still: Flags = np.ones(3, dtype=np.bool_)
        self.lowest, self.highest = np.inf, -np.inf
        self.rows_per_update = 1.0
        self.layout: list[LayoutFinding] = []
        # Chunks collected so far, and the last time and sample of the previous chunk. The first
        # finite sample is the zero of all forces.
        self._times, self._end = [np.empty(0)], -np.inf
        self._forces = [np.empty((0, 3))]
        self._repeats = [np.empty(0, dtype=np.bool_)]
        self._last = module.readings[:0]
        self._zero: Array | None = None

    def add(self, module: Tactile) -> None:
        """Add the next samples."""
        labels = list(module.labels)
        if labels and self.labels and self._end < self.labels[-1].end:
            # An identical label at the start of this chunk is the same label, which was split at
            # the boundary.
            before, after = self.labels[-1], labels[0]
            is_cut = after.start <= float(module.times[0])
            if is_cut and replace(after, start=before.start, end=before.end) == before:
                self.labels[-1] = replace(before, end=after.end)
                del labels[0]
        self.labels += labels
        if module.n_samples:
            if not self._last.size:
                readings = module.readings[:HELD_ROWS]
                self.rows_per_update = held_rows(readings, module.sensor, module.rate) or 1.0
                readings = module.readings[:LAYOUT_SAMPLES]
                self.layout = layout_findings(readings, module.sensor, module.unit)
            self._times.append(module.times)
            self._end = float(module.times[-1])
        for first in range(0, module.n_samples, SCAN_BLOCK_SAMPLES):
            readings = module.readings[first : first + SCAN_BLOCK_SAMPLES]
            joined = np.concatenate([self._last, readings])
            self._last = readings[-1:].copy()
            differs, finite = joined[1:] != joined[:-1], np.isfinite(joined)
            self._repeats.append(~differs.any(axis=(1, 2)))
            # NaN differs from itself, but is no sign of life.
            self.still &= ~(differs & finite[1:] & finite[:-1]).any(axis=(0, 1))
            self.lowest = float(np.fmin(self.lowest, np.fmin.reduce(readings, axis=None)))
            self.highest = float(np.fmax(self.highest, np.fmax.reduce(readings, axis=None)))
            values = np.ascontiguousarray(readings, dtype=np.float64)
            if self._zero is None:  # so that readings that never change have no rounding errors
                self._zero = np.nan_to_num(values[first_finite(values)], posinf=0.0, neginf=0.0)
            force = np.empty((len(values), 3))
            fill_fingertip_force(values, self._zero, self.sensor.rotations, force)
            self._forces.append(force)

    @cached_property
    def repeats(self) -> Flags:
        """(n - 1,) whether each sample after the first repeats the one before."""
        return np.concatenate(self._repeats)

    @cached_property
    def force(self) -> Tactile:
        """The module as one taxel with the fingertip force since the first sample.

        A tare is linear: it gives the same force as of all taxels.
        """
        forces = np.concatenate(self._forces)[:, None]
        skin = self.sensor
        tip = Sensor(
            f"force of {skin.name}", np.zeros((1, 3)), np.eye(3)[None], skin.normal, skin.rate,
            skin.unit,
        )  # fmt: skip
        return Tactile(tip, np.concatenate(self._times), forces)

    @cached_property
    def drift(self) -> HoldDrift:
        """Drift of the force in the longest hold."""
        drift, force = HoldDrift(), self.force
        stride = max(1, int(CHECK_INTERVAL * force.rate)) if force.n_samples > 1 else 1
        for time, value in zip(force.times[::stride], force.readings[::stride, 0], strict=True):
            drift.update(value, float(time))
        return drift


class FindingsScan:
    """Scan of a recording.

    Attributes:
        modules: by name.
        n_truth: number of samples of the truth.
    """

    def __init__(self) -> None:
        self.modules: dict[str, ModuleScan] = {}
        self.n_truth = 0
        self._markers: list[tuple[float, str]] = []
        self._last: Recording | None = None

    def add(self, part: Recording) -> None:
        """Add a recording, or its next part."""
        for name, module in part.modules.items():
            if name not in self.modules:
                self.modules[name] = ModuleScan(module)
            self.modules[name].add(module)
        self.n_truth += 0 if part.truth is None else len(part.truth.times)
        self._markers += part.markers
        self._last = replace(part, modules={n: m.slice(0, 1) for n, m in part.modules.items()})

    @cached_property
    def recording(self) -> Recording:
        """The recording with forces in place of readings.

        Raises:
            RecordingError: nothing was added.
        """
        modules = {name: scan.force for name, scan in self.modules.items()}
        if self._last is None:
            return Recording("", modules)
        return replace(self._last, modules=modules, markers=tuple(self._markers), truth=None)
