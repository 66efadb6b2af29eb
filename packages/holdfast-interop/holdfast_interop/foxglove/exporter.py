"""Export of recordings for Foxglove: MCAP files with JSON messages, and a layout of its panels."""

from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from mcap.writer import CompressionType, Writer

from holdfast.detector import Detection, detect
from holdfast.exporters.output import whole_files
from holdfast.files import file_stem
from holdfast.recordings import Recording
from holdfast_interop.foxglove.messages import Message, messages
from holdfast_interop.foxglove.schemas import (
    ARROWS_TOPIC,
    FORCE_TOPIC,
    INSTABILITY_TOPIC,
    LABEL_TOPIC,
    LOG_TOPIC,
    PHASE_TOPIC,
    SCHEMAS,
    SLIP_TOPIC,
    STABLE_TOPIC,
    STATE_TOPIC,
    TAXELS_TOPIC,
    finger_topic,
    schema_of,
    series_label,
)
from holdfast_interop.scene.hand_frames import frames_of
from holdfast_interop.scene.taxel_arrows import scene_instants

if TYPE_CHECKING:
    from holdfast.model import Model


LAYOUT_FILE = "holdfast-layout.json"
EXPORT_CHUNK_SIZE = 1 << 20
"""Number of bytes from which a chunk of the file ends."""


def export(
    recordings: Sequence[Recording],
    out: Path,
    *,
    model: "Model | None" = None,
    force: bool = False,
    progress: Callable[[Iterable[Recording]], Iterable[Recording]] = iter,
) -> dict[str, int]:
    """Write an MCAP file for each recording, and one layout for all of them, in a folder.

    Args:
        recordings: such as a `Dataset`; they are loaded one at a time.
        out: the folder.
        model: whose estimates are added.
        force: replace existing files.
        progress: wraps the recordings.

    Returns:
        Number of `files` and of `messages`.

    Raises:
        RecordingError: a recording is longer than a day.
        ModelError: the model does not fit to a recording.
        OutputError: a file exists already, or cannot be written.
    """
    fingers: dict[str, None] = {}
    topics: set[str] = set()
    n_messages = n_files = 0
    with whole_files(out, force=force) as folder:
        for recording in progress(recordings):
            file = folder / f"{file_stem(recording.name)}.mcap"
            used = write_recording(recording, file, model)
            fingers |= dict.fromkeys(recording.modules)
            topics |= used.keys()
            n_messages += sum(used.values())
            n_files += 1
        text = msgspec.json.encode(layout(list(fingers), topics))
        (folder / LAYOUT_FILE).write_bytes(msgspec.json.format(text) + b"\n")
    return {"files": n_files, "messages": n_messages}


def write_recording(recording: Recording, path: Path, model: "Model | None") -> dict[str, int]:
    """Write the file of a recording.

    Returns:
        Number of messages by topic.

    Raises:
        RecordingError: the recording is longer than a day.
        ModelError: the model does not fit to it.
    """
    scene_instants(recording)  # refuses what is too long before any work
    detection = None if model is None else detect(model, recording)
    frames, origin = frames_of(recording)
    with path.open("wb") as stream:
        log = _MessageFile(Writer(stream, EXPORT_CHUNK_SIZE, CompressionType.ZSTD), recording)
        log.describe(recording, detection, origin)
        for message in messages(recording, frames, detection, log.stamp):
            log.write(message)
        log.close()
    return log.n_messages


class _MessageFile:
    """MCAP file of JSON messages; a time before 1970 is shifted to it.

    Attributes:
        n_messages: number of messages by topic.
    """

    def __init__(self, writer: Writer, recording: Recording) -> None:
        self._writer = writer
        times = [recording.start, *(time for time, _ in recording.markers)]
        if recording.truth is not None and len(recording.truth.times):
            times.append(float(recording.truth.times[0]))
        # Times of MCAP are unsigned.
        self._offset = max(0.0, -min(times))
        self._encoder = msgspec.json.Encoder()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.n_messages: dict[str, int] = {}
        writer.start("", "holdfast")

    def describe(self, recording: Recording, detection: Detection | None, origin: str) -> None:
        """Write what the messages do not say as metadata of the file."""
        units = {name: str(module.unit) for name, module in recording.modules.items()}
        facts = {
            "name": recording.name,
            "units": units,
            "metadata": dict(recording.metadata),
            "time_offset": self._offset,
            "frames": origin,
            "estimates": "none" if detection is None else sorted(detection.fingers),
        }
        encode = msgspec.json.Encoder(enc_hook=str).encode
        texts = {key: x if isinstance(x, str) else encode(x).decode() for key, x in facts.items()}
        self._writer.add_metadata("holdfast", texts)

    def nanoseconds(self, time: float) -> int:
        """Return a time [s] as the file has it [ns]."""
        return max(0, round((time + self._offset) * 1e9))

    def stamp(self, time: float) -> dict[str, int]:
        """Return a time [s] as Foxglove's messages have it."""
        seconds, nanoseconds = divmod(self.nanoseconds(time), 1_000_000_000)
        return {"sec": seconds, "nsec": nanoseconds}

    def write(self, message: Message) -> None:
        """Write a message; the schema and the channel of its topic come before the first."""
        topic = message.topic
        if topic not in self._channels:
            name = schema_of(topic)
            if name not in self._schemas:
                text = msgspec.json.encode({"title": name, **SCHEMAS[name]})
                self._schemas[name] = self._writer.register_schema(name, "jsonschema", text)
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[name]
            )
        document = message.document
        # Scenes and transforms have the stamp inside each entity, where Foxglove reads it.
        if "entities" not in document and "transforms" not in document:
            document = {"timestamp": self.stamp(message.time), **document}
        time = self.nanoseconds(message.time)
        self._writer.add_message(self._channels[topic], time, self._encoder.encode(document), time)
        self.n_messages[topic] = self.n_messages.get(topic, 0) + 1

    def close(self) -> None:
        """Write the end of the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]


LAYOUT_VERSION = 1
"""Version of the form, and of each panel in it."""
ROOT_FRAME = "world"
CAMERA = {
    "distance": 0.35,
    "perspective": True,
    "phi": 65.0,
    "thetaOffset": 60.0,
    "fovy": 45.0,
    "near": 0.01,
    "far": 100.0,
}
"""View of the hand from 0.35 m."""
INFO_LEVEL = 2
"""Level of Foxglove from which messages are shown."""


def layout(fingers: Collection[str], topics: Collection[str]) -> dict[str, object]:
    """Return a layout: the hand with its arrows, plots, states and the log.

    Args:
        fingers: names of the fingers of all recordings.
        topics: topics of all recordings; panels without one are left out.

    Example:
        >>> layout(["thumb"], ["/holdfast/force"])["content"]["direction"]
        'row'
    """
    plots = [
        plot_panel(title, topic, fingers)
        for title, topic in (
            ("Force", FORCE_TOPIC),
            ("Instability", INSTABILITY_TOPIC),
            ("P(stable)", STABLE_TOPIC),
            ("P(slip)", SLIP_TOPIC),
        )
        if topic in topics
    ]
    # An estimate and its label beside each other, the phase of the experiment below all.
    named = []
    for finger in fingers:
        named.append((finger, finger_topic(STATE_TOPIC, finger)))
        named.append((f"{finger} (label)", finger_topic(LABEL_TOPIC, finger)))
    named.append(("phase", PHASE_TOPIC))
    states = [
        {"value": f"{topic}.state", "label": name} for name, topic in named if topic in topics
    ]
    if states:
        series = [{**path, "timestampMethod": "receiveTime"} for path in states]
        plots.append(_panel("StateTransitions", "States", {"paths": series, "isSynced": True}))
    shown = {topic: {"visible": True} for topic in (ARROWS_TOPIC, TAXELS_TOPIC)}
    scene = {"topics": shown, "cameraState": CAMERA, "followTf": ROOT_FRAME}
    hand = _panel("ThreeDee", "Hand", scene)
    log = _panel("Log", "Log", {"topicToRender": LOG_TOPIC, "minLogLevel": INFO_LEVEL})
    left = split_panel("column", [(hand, 3), (log, 1)])
    right = split_panel("column", [(panel, 1) for panel in plots])
    return {"version": LAYOUT_VERSION, "content": split_panel("row", [(left, 1), (right, 1)])}


def plot_panel(title: str, topic: str, fingers: Iterable[str]) -> dict[str, object]:
    """Return a plot of the series of all fingers on a topic."""
    paths = [
        {
            "value": f'{topic}.scalars[:]{{label=="{series_label(finger)}"}}.value',
            "label": finger,
            "enabled": True,
            "timestampMethod": "receiveTime",
        }
        for finger in fingers
    ]
    return _panel("Plot", title, {"paths": paths, "isSynced": True})


def _panel(kind: str, title: str, config: dict[str, object]) -> dict[str, object]:
    return {
        "type": "panel",
        "panelType": kind,
        "config": config,
        "title": title,
        "version": LAYOUT_VERSION,
    }


def split_panel(direction: str, items: Iterable[tuple[object, float]]) -> dict[str, object]:
    """Return panels beside or below each other, with their shares of the space."""
    parts = [{"proportion": share, "content": content} for content, share in items]
    return {"type": "split", "direction": direction, "items": parts}
