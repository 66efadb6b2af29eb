"""Series and events of a recording and its estimates."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import ContactState, faults_of
from holdfast.detection import FingerTrace
from holdfast.detection.slips import SlipWatch
from holdfast.detection.traces import CAUSE_BY_CODE, STATE_BY_CODE
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast_interop.scene.taxel_arrows import zeroed

Track = tuple[Array, npt.NDArray[Any]]
"""Times (n,) [s] and values (n,)."""
Traces = Mapping[str, FingerTrace]
ARROW_COLOURS = {
    ContactState.UNKNOWN: (0.34, 0.71, 0.91),
    ContactState.NO_CONTACT: (0.78, 0.78, 0.78),
    ContactState.UNSTABLE: (0.88, 0.54, 0.24),
    ContactState.STABLE: (0.0, 0.62, 0.45),
}
"""Colours of the arrows of a finger, by its state (or, without a model, its label)."""


class LogEvent(NamedTuple):
    """A line of a log: time [s], level, name of the finger or `marker`, and text."""

    time: float
    is_warning: bool
    name: str
    text: str


def series(recording: Recording, traces: Traces) -> dict[str, dict[str, Track]]:
    """Return what plots show, by quantity and finger; quantities without values are left out."""
    forces: dict[str, Track] = {}
    for name, module in recording.modules.items():
        if name in traces:
            forces[name] = traces[name].times, np.linalg.norm(traces[name].force, axis=1)
        elif module.n_samples:
            force = np.einsum("tij,ntj->ni", module.sensor.rotations, zeroed(recording, name))
            forces[name] = module.times, np.linalg.norm(force, axis=1)
    by_kind: dict[str, dict[str, Track]] = {"force": forces}
    for column in ("instability", "stable_probability", "slip_probability", "slip_speed"):
        columns = {name: (trace.times, getattr(trace, column)) for name, trace in traces.items()}
        by_kind[column] = {name: track for name, track in columns.items() if track[1] is not None}
    truth = recording.truth
    if truth is not None:
        by_kind["true_slip_speed"] = {
            finger: (truth.times, 1000.0 * arrays["slip_speed"])  # [mm/s], as the estimate has it
            for finger, arrays in truth.fingers.items()
            if "slip_speed" in arrays and arrays["slip_speed"].ndim == 1
        }
    return {quantity: tracks for quantity, tracks in by_kind.items() if tracks}


def state_codes(recording: Recording, traces: Traces) -> dict[str, Track]:
    """Return the states that colour the arrows of a finger: of estimates, or else of labels."""
    return {
        name: (traces[name].times, traces[name].state)
        if name in traces
        else (module.times, module.label_states)
        for name, module in recording.modules.items()
        if module.n_samples
    }


def events(recording: Recording, traces: Traces) -> list[LogEvent]:
    """Return markers, alarms, slips and faults in the order of their times."""
    entries = [LogEvent(time, False, "marker", text) for time, text in recording.markers]
    for finger, trace in traces.items():
        times, causes = trace.times.tolist(), trace.cause.tolist()
        # An alarm is a change from STABLE to anything else but UNKNOWN.
        pairs = pairwise(STATE_BY_CODE[code] for code in trace.state.tolist())
        for time, (before, state), cause in zip(times[1:], pairs, causes[1:], strict=True):
            if before is ContactState.STABLE and state not in (before, ContactState.UNKNOWN):
                why = f" ({CAUSE_BY_CODE[cause]})" if CAUSE_BY_CODE[cause] else ""
                text = f"alarm: {state.value}{why}, was {before.value}"
                entries.append(LogEvent(time, True, finger, text))
        masks = trace.faults.astype(np.int64)
        new = masks & ~np.concatenate([[0], masks[:-1]])
        for k in np.flatnonzero(new).tolist():
            text = f"fault: {', '.join(faults_of(int(new[k])))}"
            entries.append(LogEvent(times[k], True, finger, text))
        for slip in SlipWatch().update(finger, trace.estimates()):
            if slip.end is None:
                text = f"slip begins, probability {slip.max_probability:.2f}"
                entries.append(LogEvent(slip.begin, True, finger, text))
            else:
                far = "" if slip.distance is None else f", {slip.distance:.2f} mm"
                text = f"slip ends after {slip.end - slip.begin:.3f} s{far}"
                entries.append(LogEvent(slip.end, False, finger, text))
    return sorted(entries)
