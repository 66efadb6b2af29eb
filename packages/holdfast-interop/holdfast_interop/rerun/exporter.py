"""Export of recordings for Rerun: a file with its layout for each of them."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr

from holdfast.contact import UNKNOWN
from holdfast.detection import detect
from holdfast.detection.traces import STATE_BY_CODE
from holdfast.exporters.output import whole_files
from holdfast.files import file_stem
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast_interop.rerun.view import (
    ARROW_RADIUS,
    EVENT_LOG,
    NO_LABEL,
    STATE_LANES,
    blueprint,
    draw_hand,
    entity,
    frame_parts,
    long_enough,
    name_states,
    time_column,
)
from holdfast_interop.scene.hand_frames import Frame, frames_of
from holdfast_interop.scene.taxel_arrows import (
    SCENE_RATE,
    arrow_scale,
    module_forces,
    scene_instants,
)
from holdfast_interop.scene.tracks import (
    ARROW_COLOURS,
    Traces,
    Track,
    events,
    series,
    state_codes,
)

if TYPE_CHECKING:
    from holdfast.detection import Model


def export(
    recordings: Sequence[Recording],
    out: Path,
    *,
    model: "Model | None" = None,
    force: bool = False,
    progress: Callable[[Iterable[Recording]], Iterable[Recording]] = iter,
) -> dict[str, int]:
    """Write a file for each recording in a folder; return the number of `files`.

    Args:
        recordings: such as a `Dataset`; they are loaded one at a time.
        out: the folder.
        model: whose estimates are added.
        force: replace existing files.
        progress: wraps the recordings.

    Raises:
        RecordingError: a recording is longer than a day.
        ModelError: the model does not fit to a recording.
        OutputError: a file exists already, or cannot be written.
    """
    n_files = 0
    with whole_files(out, force=force) as folder:
        for recording in progress(recordings):
            write_recording(recording, folder / f"{file_stem(recording.name)}.rrd", model)
            n_files += 1
    return {"files": n_files}


def write_recording(recording: Recording, path: Path, model: "Model | None") -> None:
    """Write the file of a recording.

    Raises:
        RecordingError: the recording is longer than a day.
        ModelError: the model does not fit to it.
    """
    instants = scene_instants(recording)
    traces: Traces = {} if model is None else detect(model, recording).fingers
    tracks = series(recording, traces)
    frames = frames_of(recording)
    with rr.RecordingStream("holdfast") as stream:
        stream.save(path, default_blueprint=blueprint(tracks, frames))
        stream.send_recording_name(recording.name)
        write_hand(stream, recording, frames, traces, instants)
        for quantity, fingers in tracks.items():
            for finger, (times, values) in fingers.items():
                columns = rr.Scalars.columns(scalars=values)
                index = time_column(times, recording.start)
                stream.send_columns(entity(quantity, finger), [index], columns)
        write_states(stream, recording, traces)
        log = events(recording, traces)
        if log:
            index = time_column(np.array([event.time for event in log]), recording.start)
            texts = [f"{event.name}: {event.text}" for event in log]
            levels = ["WARN" if event.is_warning else "INFO" for event in log]
            stream.send_columns(EVENT_LOG, [index], rr.TextLog.columns(text=texts, level=levels))
        stream.disconnect()  # writes the end of the file


def write_hand(
    stream: Any,  # noqa: ANN401
    recording: Recording,
    frames: Sequence[Frame],
    traces: Traces,
    instants: Array,
) -> None:
    """Write the taxels, the frames that move and the arrows, `SCENE_RATE` times a second."""
    paths = draw_hand(stream, recording, frames)
    parts = frame_parts(frames)
    index = time_column(instants, recording.start)
    for frame in frames:
        if len(frame.times) > 1:
            poses = np.array([frame.at(time) for time in instants.tolist()])
            columns = rr.Transform3D.columns(
                translation=poses[:, :3], quaternion=poses[:, [4, 5, 6, 3]]
            )
            stream.send_columns(entity(*parts[frame.name]), [index], columns)
    arrows = module_forces(recording, instants)
    scale = arrow_scale(arrows)
    codes = state_codes(recording, traces)
    for name, module in arrows.items():
        samples = [module.sample_at(time, 1 / SCENE_RATE) for time in instants.tolist()]
        rows = np.array([0 if k is None else k for k in samples])
        vectors = scale * module.forces[rows]
        # No arrow in a gap: an empty row takes the last ones away.
        shown = long_enough(vectors) & np.array([k is not None for k in samples])[:, None]
        times, states = codes[name]
        # Estimates begin later than readings: before the first, its colour.
        latest = np.maximum(np.searchsorted(times, instants, side="right") - 1, 0)
        colours = np.array([ARROW_COLOURS[STATE_BY_CODE[code]] for code in states[latest].tolist()])
        instant, taxel = np.nonzero(shown)
        columns = rr.Arrows3D.columns(
            vectors=vectors[shown],
            origins=recording.modules[name].sensor.positions[taxel],
            radii=np.full(len(taxel), ARROW_RADIUS),
            colors=colours[instant],
        ).partition(shown.sum(axis=1))
        stream.send_columns(f"{paths[name]}/arrows", [index], columns)


def write_states(stream: Any, recording: Recording, traces: Traces) -> None:  # noqa: ANN401
    """Write the changes of the states of estimates, of labels and of the experiment."""
    lanes: dict[str, Track] = {}
    for finger, trace in traces.items():
        lanes[entity(STATE_LANES, finger)] = trace.times, words_of(trace.state)
    for name, module in recording.modules.items():
        if module.labels:
            words = words_of(module.label_states, unknown=NO_LABEL)
            lanes[entity(STATE_LANES, name, "label")] = module.times, words
    name_states(stream, lanes)
    truth = recording.truth
    if truth is not None and "phase" in truth.hand and truth.hand["phase"].dtype.kind == "U":
        lanes[entity(STATE_LANES, "phase")] = truth.times, truth.hand["phase"]
    for lane, (times, words) in lanes.items():
        if len(times):
            changed = np.concatenate([[True], words[1:] != words[:-1]])
            columns = rr.StateChange.columns(state=words[changed].tolist())
            stream.send_columns(lane, [time_column(times[changed], recording.start)], columns)


def words_of(codes: Any, unknown: str = "") -> Any:  # noqa: ANN401
    """Return the words of states, (n,); `unknown` in place of that state if it is given."""
    words = np.array([STATE_BY_CODE[code].value for code in codes.tolist()])
    return np.where(codes == UNKNOWN, unknown, words) if unknown else words
