"""The content of a recording, as `holdfast info` shows it."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from holdfast.contact import LABEL_STATES, MAX_TAXELS, Fault, taxels_of
from holdfast.detection import Detector, Model, Tare
from holdfast.errors import RecordingError
from holdfast.io import read_chunks
from holdfast.labelling.review.findings import (
    faulty_readings,
    findings_of_scan,
    hidden_labels,
    with_oddities,
)
from holdfast.labelling.review.scan import FindingsScan
from holdfast.labelling.server.workspace import summary_of
from holdfast.recordings import Label, Recording
from holdfast.sensors import taxel_number

SAMPLES_OF_PART = 4096
"""Samples that are read at a time; it bounds the memory."""


def content_of(path: Path, tare: Tare, recording: Recording | None = None) -> dict[str, Any]:
    """Return the content of a recording, as JSON has it.

    Args:
        path: of the recording.
        tare: tare for the faults.
        recording: the recording, if it was loaded; by default it is read in parts, so that it
            may be larger than the memory.

    Raises:
        RecordingError: it cannot be read.
    """
    scan, faults = FindingsScan(), _FaultCounts(tare)
    for part in [recording] if recording else read_chunks(path, SAMPLES_OF_PART):
        scan.add(part)
        faults.add(part)
        truth = part.truth
    summary, hidden = scan.recording, hidden_labels(path)
    findings = [*findings_of_scan(scan), *([hidden] if hidden else [])]
    for name, module in scan.modules.items():
        n_invalid, n_samples = faults.of(name).get(Fault.INVALID, 0), module.force.n_samples
        findings += faulty_readings(name, n_invalid, n_samples, faults.stuck_taxels(name))
    findings = with_oddities(findings, scan, path)
    return {
        "name": summary.name,
        "modules": {
            name: {
                "sensor": module.sensor.name,
                "n_taxels": module.sensor.n_taxels,
                "unit": module.sensor.unit,
                **({} if module.sensor.step is None else {"step": module.sensor.step}),
                **({"rests_at_zero": True} if module.sensor.rests_at_zero else {}),
                "n_samples": module.force.n_samples,
                "rate": module.force.rate,
                "gaps": module.force.n_gaps,
                "repeats": int(module.repeats.sum()),
                "drift": None if isnan(module.drift.per_minute) else module.drift.per_minute,
                "labels": label_seconds(module.labels),
                "faults": {fault.value: n for fault, n in faults.of(name).items() if n},
            }
            for name, module in scan.modules.items()
        },
        "start": summary.start,
        "duration": summary.duration,
        "complete": summary.complete,
        "metadata": summary.metadata,
        "markers": [{"time": time, "text": text} for time, text in summary.markers],
        "media": [{"path": path, "offset": offset} for path, offset in summary.media],
        "truth": truth
        and {
            "n_samples": scan.n_truth,
            "hand": list(truth.hand),
            "fingers": {finger: list(arrays) for finger, arrays in truth.fingers.items()},
        },
        "digest": recording.digest if recording else _digest(path),
        "findings": [finding._asdict() for finding in findings],
    }


def label_seconds(labels: Iterable[Label]) -> dict[str, float]:
    """Return the total duration of the labels of each state [s]."""
    seconds = {state.value.lower(): 0.0 for state in LABEL_STATES}
    for label in labels:
        seconds[label.state.value.lower()] += label.end - label.start
    return seconds


def _digest(path: Path) -> str | None:
    """Return the digest of a recording; None if its file has none and it is too large to load."""
    try:
        return summary_of(path).digest
    except RecordingError:  # its parts were read without an error
        return None


class _FaultCounts:
    """Number of samples of each module with each fault that a detector finds."""

    def __init__(self, tare: Tare) -> None:
        self._counts: dict[str, dict[Fault, int]] = {}
        self._model = msgspec.structs.replace(Model.load("builtin:noise-floor"), tare=str(tare))
        self._detectors: dict[str, Detector] = {}
        self._stuck: dict[str, set[int]] = {}

    def stuck_taxels(self, name: str) -> list[int]:
        """Return the numbers of the taxels of a module that were stuck, from 1."""
        return [taxel_number(i) for i in sorted(self._stuck.get(name, ()))]

    def of(self, name: str) -> Mapping[Fault, int]:
        """Return the number of samples of a module with each fault."""
        return self._counts.get(name, {})

    def add(self, part: Recording) -> None:
        """Add a recording, or its next part."""
        for name, module in part.modules.items():
            if not module.n_samples or module.sensor.n_taxels > MAX_TAXELS:
                continue
            alone = replace(part, modules={name: module}, truth=None)
            if name not in self._detectors:
                self._detectors[name] = Detector.for_recording(self._model, alone)
                self._counts[name] = dict.fromkeys(Fault, 0)
            trace = self._detectors[name].run(alone).fingers[name]
            masks = trace.faults
            # Alone: with another fault at the same sample, it may be of another taxel.
            is_stuck = masks == 1 << list(Fault).index(Fault.STUCK)
            words = np.bitwise_or.reduce(trace.faulty_taxels[is_stuck], axis=0)
            self._stuck.setdefault(name, set()).update(taxels_of(words))
            for bit, fault in enumerate(Fault):
                self._counts[name][fault] += int((masks >> bit & 1).sum())
