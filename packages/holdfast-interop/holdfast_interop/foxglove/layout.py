"""Layout of Foxglove's panels for exported recordings, in the form that its SDK writes."""

from collections.abc import Collection, Iterable

from holdfast_interop.foxglove.schemas import (
    ARROWS_TOPIC,
    FORCE_TOPIC,
    INSTABILITY_TOPIC,
    LABEL_TOPIC,
    LOG_TOPIC,
    PHASE_TOPIC,
    SLIP_TOPIC,
    STABLE_TOPIC,
    STATE_TOPIC,
    TAXELS_TOPIC,
    finger_topic,
    series_label,
)

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
        _plot(title, topic, fingers)
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
    left = _split("column", [(hand, 3), (log, 1)])
    right = _split("column", [(panel, 1) for panel in plots])
    return {"version": LAYOUT_VERSION, "content": _split("row", [(left, 1), (right, 1)])}


def _plot(title: str, topic: str, fingers: Iterable[str]) -> dict[str, object]:
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


def _split(direction: str, items: Iterable[tuple[object, float]]) -> dict[str, object]:
    parts = [{"proportion": share, "content": content} for content, share in items]
    return {"type": "split", "direction": direction, "items": parts}
