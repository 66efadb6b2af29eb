"""Messages for Foxglove of a recording and its estimates, as plain data."""

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import UNKNOWN
from holdfast.detector import Detection
from holdfast.detector.detection import CAUSE_BY_CODE, REASON_BY_CODE, STATE_BY_CODE
from holdfast.recordings import GAP_PERIODS, Recording
from holdfast.sensors.types import Array, Integers
from holdfast_interop.foxglove.schemas import (
    ARROWS_TOPIC,
    EMPTY_SHAPES,
    FORCE_TOPIC,
    INSTABILITY_TOPIC,
    LABEL_TOPIC,
    LOG_TOPIC,
    PHASE_TOPIC,
    SLIP_TOPIC,
    SPEED_TOPIC,
    STABLE_TOPIC,
    STATE_TOPIC,
    TAXELS_TOPIC,
    TRANSFORMS_TOPIC,
    TRUE_SPEED_TOPIC,
    finger_topic,
    series_label,
)
from holdfast_interop.scene.hand_frames import Frame, module_frame
from holdfast_interop.scene.taxel_arrows import (
    SCENE_RATE,
    SHORTEST_ARROW,
    ModuleArrows,
    arrow_scale,
    module_forces,
    orientations,
    scene_instants,
)
from holdfast_interop.scene.tracks import ARROW_COLOURS, Traces, Track, events, series, state_codes

REPEAT_SECONDS = 1.0
"""Time after which a state is sent again if it does not change [s]."""
INFO, WARNING = 2, 3
"""Levels of Foxglove's log."""

Colour = dict[str, float]
Stamp = Callable[[float], dict[str, int]]


def rgba(red: float, green: float, blue: float, alpha: float = 1.0) -> Colour:
    """Return a colour as Foxglove has it, each part from 0 to 1."""
    return {"r": red, "g": green, "b": blue, "a": alpha}


TAXEL_COLOUR = rgba(0.4, 0.4, 0.4, 0.6)
TAXEL_DIAMETER = 0.0012
NAME_SIZE = 0.006
"""Size of the name of a module [m]."""
ARROW_WIDTHS = (0.0006, 0.0015)
"""Diameters of the shaft and the head of an arrow [m]."""
HEAD_SHARE = 0.3
"""Length of the head of an arrow as a share of the arrow."""
_STRAIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
SERIES_TOPICS = {
    "force": FORCE_TOPIC,
    "instability": INSTABILITY_TOPIC,
    "stable_probability": STABLE_TOPIC,
    "slip_probability": SLIP_TOPIC,
    "slip_speed": SPEED_TOPIC,
    "true_slip_speed": TRUE_SPEED_TOPIC,
}
"""Topic of each quantity of `series`."""


class Message(NamedTuple):
    """A message: time [s], topic and content as plain data without its time stamp."""

    time: float
    topic: str
    document: dict[str, Any]


def messages(
    recording: Recording, frames: Sequence[Frame], detection: Detection | None, stamp: Stamp
) -> Iterator[Message]:
    """Yield all messages of a recording in the order of their times.

    Args:
        recording: the recording.
        frames: of its modules.
        detection: estimates of a model, or None.
        stamp: makes the time stamp of a message of a time [s].
    """
    traces = {} if detection is None else detection.fingers
    instants = scene_instants(recording)
    parts = [
        transform_messages(frames, instants, stamp),  # before what is drawn in these frames
        taxel_messages(recording, stamp),
        arrow_messages(recording, traces, instants, stamp),
        *scalar_messages(recording, traces),
        *state_messages(recording, traces),
        log_messages(recording, traces),
    ]
    # Merged, not sorted: all messages of a recording would not fit into memory.
    return heapq.merge(*parts, key=attrgetter("time"))


def scalar_messages(recording: Recording, traces: Traces) -> list[Iterator[Message]]:
    """Return the series of plots; a topic has the values of all fingers."""
    return [
        _series(SERIES_TOPICS[name], tracks) for name, tracks in series(recording, traces).items()
    ]


def _series(topic: str, tracks: Mapping[str, Track]) -> Iterator[Message]:
    """Yield messages at the samples of the fastest finger; null where a finger has a gap."""
    # One message has the values of all fingers, so that a plot has one path for each of them.
    grid = max((times for times, _ in tracks.values()), key=len)
    columns: list[Array] = []
    for times, values in tracks.values():
        if not len(times):
            columns.append(np.full(len(grid), np.nan))
            continue
        # The latest value at each time, unless it is more than 3 periods old.
        rows = np.searchsorted(times, grid, side="right") - 1
        period = float(np.median(np.diff(times))) if len(times) > 1 else np.inf
        # Before the first sample `rows` is -1, which would read the last one.
        is_old = (rows < 0) | (grid - times[rows] > GAP_PERIODS * period)
        columns.append(np.where(is_old, np.nan, values[rows]))
    labels = [series_label(finger) for finger in tracks]
    for time, row in zip(grid.tolist(), np.column_stack(columns).tolist(), strict=True):
        pairs = zip(labels, row, strict=True)
        scalars = [{"label": label, "value": value} for label, value in pairs]
        yield Message(time, topic, {"scalars": scalars})


def state_messages(recording: Recording, traces: Traces) -> list[Iterator[Message]]:
    """Return the states of estimates, of labels and of the experiment."""
    parts = [
        changes_of_state(
            finger_topic(STATE_TOPIC, finger),
            trace.times,
            np.stack([trace.state, trace.reason, trace.cause]),
            lambda state, reason, cause: {
                "state": STATE_BY_CODE[state].value,
                "reason": REASON_BY_CODE[reason].value,
                "cause": CAUSE_BY_CODE[cause] or "",
            },
        )
        for finger, trace in traces.items()
    ]
    for name, module in recording.modules.items():
        if module.labels:
            topic, codes = finger_topic(LABEL_TOPIC, name), module.label_states[None]
            # Samples without a label have the code of UNKNOWN, which a label never is.
            parts.append(
                changes_of_state(
                    topic,
                    module.times,
                    codes,
                    lambda code: {
                        "state": "no label" if code == UNKNOWN else STATE_BY_CODE[code].value
                    },
                )
            )
    truth = recording.truth
    if truth is not None and "phase" in truth.hand and truth.hand["phase"].dtype.kind == "U":
        phases, numbers = np.unique(truth.hand["phase"], return_inverse=True)
        parts.append(
            changes_of_state(
                PHASE_TOPIC, truth.times, numbers[None], lambda code: {"state": str(phases[code])}
            )
        )
    return parts


def changes_of_state(
    topic: str, times: Array, codes: npt.NDArray[Any], document: Callable[..., dict[str, Any]]
) -> Iterator[Message]:
    """Yield a message at every change of the codes (n_codes, n), and at least once a second."""
    # Repeated, so that a viewer that jumps into the file has a state within a second.
    latest, sent_at = None, -np.inf
    for time, row in zip(times.tolist(), codes.T.tolist(), strict=True):
        if row != latest or time - sent_at >= REPEAT_SECONDS:
            latest, sent_at = row, time
            yield Message(time, topic, document(*row))


def log_messages(recording: Recording, traces: Traces) -> Iterator[Message]:
    """Yield markers, alarms, slips and faults."""
    for event in events(recording, traces):
        level = WARNING if event.is_warning else INFO
        document = {
            "level": level, "message": event.text, "name": event.name, "file": "", "line": 0
        }  # fmt: skip
        yield Message(event.time, LOG_TOPIC, document)


def arrow_messages(
    recording: Recording, traces: Traces, instants: Array, stamp: Stamp
) -> Iterator[Message]:
    """Yield the arrows of all modules at each instant; none of a module in a gap."""
    states = state_codes(recording, traces)
    arrows = module_forces(recording, instants)
    scale = arrow_scale(arrows)
    places = {name: recording.modules[name].sensor.positions for name in arrows}
    for time in instants.tolist():
        entities = []
        for name, module in arrows.items():
            k = module.sample_at(time, 1 / SCENE_RATE)
            times, codes = states[name]
            # Estimates begin later than readings: before the first, its colour.
            row = max(int(np.searchsorted(times, time, side="right")) - 1, 0)
            colour = rgba(*ARROW_COLOURS[STATE_BY_CODE[codes[row]]])
            drawn = [] if k is None else shapes_of_arrows(module, k, scale, places[name], colour)
            entities.append(_entity(name, stamp(time), arrows=drawn))
        yield Message(time, ARROWS_TOPIC, {"deletions": [], "entities": entities})


def shapes_of_arrows(
    module: ModuleArrows, k: int, scale: float, places: Array, colour: Colour
) -> list[dict[str, Any]]:
    """Return the arrows of a module at sample `k` that are long enough to be seen."""
    lengths = scale * np.linalg.norm(module.forces[k], axis=1)
    kept: Integers = np.flatnonzero(lengths > SHORTEST_ARROW)
    if not len(kept):
        return []
    lengths = lengths[kept]
    turned = orientations(module.forces[k][kept] * (scale / lengths[:, None]))
    # JSON has every digit; micrometres are enough.
    rows = np.round(np.column_stack([places[kept], turned, lengths]), 6).tolist()
    shaft, head = ARROW_WIDTHS
    return [
        {
            "pose": _pose(row[:3], row[3:7]),
            "shaft_length": row[7] * (1 - HEAD_SHARE),
            "shaft_diameter": shaft,
            "head_length": row[7] * HEAD_SHARE,
            "head_diameter": head,
            "color": colour,
        }
        for row in rows
    ]


def taxel_messages(recording: Recording, stamp: Stamp) -> Iterator[Message]:
    """Yield a dot for each taxel, and the name of each module, once."""
    entities = []
    size = dict.fromkeys("xyz", TAXEL_DIAMETER)
    for name, module in recording.modules.items():
        places = np.round(module.sensor.positions, 6).tolist()
        dots = [{"pose": _pose(p), "size": size, "color": TAXEL_COLOUR} for p in places]
        middle = (module.sensor.positions.mean(axis=0) - 0.02 * module.sensor.normal).tolist()
        text = {
            "pose": _pose(middle),
            "billboard": True,
            "font_size": NAME_SIZE,
            "scale_invariant": False,
            "color": rgba(0.2, 0.2, 0.2),
            "text": name,
        }
        entities.append(_entity(name, stamp(recording.start), spheres=dots, texts=[text]))
    yield Message(recording.start, TAXELS_TOPIC, {"deletions": [], "entities": entities})


def _entity(
    module: str,
    time: dict[str, int],
    *,
    arrows: Sequence[object] = (),
    spheres: Sequence[object] = (),
    texts: Sequence[object] = (),
) -> dict[str, Any]:
    """Return shapes in the frame of a module, which stay until it has others."""
    return {
        "timestamp": time,
        "frame_id": module_frame(module),
        "id": module,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        "arrows": arrows,
        "spheres": spheres,
        "texts": texts,
        **{shape: [] for shape in EMPTY_SHAPES},
    }


def _pose(place: Iterable[float], turned: Iterable[float] | None = None) -> dict[str, Any]:
    quaternion = _STRAIGHT if turned is None else dict(zip("xyzw", turned, strict=True))
    return {"position": dict(zip("xyz", place, strict=True)), "orientation": quaternion}


def transform_messages(frames: Sequence[Frame], instants: Array, stamp: Stamp) -> Iterator[Message]:
    """Yield all frames at the start, then those that move at each instant."""
    moving = [frame for frame in frames if len(frame.times) > 1]
    for k, time in enumerate(instants.tolist()):
        sent = frames if k == 0 else moving
        if sent:
            transforms = []
            for frame in sent:
                x, y, z, qw, qx, qy, qz = np.round(frame.at(time), 7).tolist()
                transforms.append(
                    {
                        "timestamp": stamp(time),
                        "parent_frame_id": frame.parent,
                        "child_frame_id": frame.name,
                        "translation": {"x": x, "y": y, "z": z},
                        "rotation": {"x": qx, "y": qy, "z": qz, "w": qw},
                    }
                )
            yield Message(time, TRANSFORMS_TOPIC, {"transforms": transforms})
