"""JSON schemas of the messages for Foxglove, and their topics.

The `foxglove.*` schemas have the names and fields by which Foxglove knows how to draw them.
"""

import re
from collections.abc import Iterable, Mapping
from hashlib import blake2b
from typing import Any

Schema = dict[str, Any]

SCALARS_SCHEMA, STATE_SCHEMA = "holdfast.Scalars", "holdfast.State"
LOG_SCHEMA, SCENE_SCHEMA = "foxglove.Log", "foxglove.SceneUpdate"
TRANSFORMS_SCHEMA = "foxglove.FrameTransforms"

FORCE_TOPIC, INSTABILITY_TOPIC = "/holdfast/force", "/holdfast/instability"
STABLE_TOPIC, SLIP_TOPIC = "/holdfast/stable_probability", "/holdfast/slip_probability"
SPEED_TOPIC, TRUE_SPEED_TOPIC = "/holdfast/slip_speed", "/holdfast/truth/slip_speed"
STATE_TOPIC, LABEL_TOPIC, PHASE_TOPIC = "/holdfast/state/", "/holdfast/label/", "/holdfast/phase"
LOG_TOPIC, ARROWS_TOPIC, TAXELS_TOPIC = "/holdfast/log", "/holdfast/arrows", "/holdfast/taxels"
TRANSFORMS_TOPIC = "/tf"

_NOT_IN_TOPICS = re.compile(r"[^A-Za-z0-9_/]")


def finger_topic(prefix: str, finger: str) -> str:
    """Return the topic of a finger; a hash is added where characters must be replaced.

    Example:
        >>> finger_topic("/holdfast/state/", "index/1")
        '/holdfast/state/index/1'
        >>> finger_topic("/holdfast/state/", "left hand")
        '/holdfast/state/left_hand_17e0c719'
    """
    plain = _NOT_IN_TOPICS.sub("_", finger)
    # Two names that differ in such characters only need two topics.
    if plain != finger or not finger.strip("/"):
        plain += "_" + blake2b(finger.encode(errors="surrogatepass"), digest_size=4).hexdigest()
    return f"{prefix}{plain}"


def series_label(finger: str) -> str:
    """Return the label of a finger's series, which a path of a plot has between quotes."""
    return finger.replace('"', "'").replace("\\", "/")


def _object(**properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _array(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def _numbers(names: Iterable[str]) -> Schema:
    return _object(**{name: {"type": "number"} for name in names})


_TEXT: Schema = {"type": "string"}
_NUMBER: Schema = {"type": "number"}
_INTEGER: Schema = {"type": "integer"}
_TIME = {"title": "time", **_object(sec=_INTEGER, nsec=_INTEGER)}
_DURATION = {"title": "duration", **_object(sec=_INTEGER, nsec=_INTEGER)}
_VECTOR, _QUATERNION, _COLOUR = _numbers("xyz"), _numbers("xyzw"), _numbers("rgba")
_POSE = _object(position=_VECTOR, orientation=_QUATERNION)
_ARROW = _object(
    pose=_POSE, shaft_length=_NUMBER, shaft_diameter=_NUMBER, head_length=_NUMBER,
    head_diameter=_NUMBER, color=_COLOUR,
)  # fmt: skip
_SPHERE = _object(pose=_POSE, size=_VECTOR, color=_COLOUR)
_SCENE_TEXT = _object(
    pose=_POSE, billboard={"type": "boolean"}, font_size=_NUMBER,
    scale_invariant={"type": "boolean"}, color=_COLOUR, text=_TEXT,
)  # fmt: skip
EMPTY_SHAPES = ("cubes", "cylinders", "lines", "triangles", "models")
"""Kinds of shapes of an entity that are not used; Foxglove expects all of them."""
_ENTITY = _object(
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked={"type": "boolean"},
    metadata=_array(_object(key=_TEXT, value=_TEXT)),
    arrows=_array(_ARROW),
    spheres=_array(_SPHERE),
    texts=_array(_SCENE_TEXT),
    **{shape: _array({"type": "object"}) for shape in EMPTY_SHAPES},
)
_DELETION = _object(timestamp=_TIME, type=_INTEGER, id=_TEXT)
_TRANSFORM = _object(
    timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR,
    rotation=_QUATERNION,
)  # fmt: skip

SCHEMAS: Mapping[str, Schema] = {
    SCALARS_SCHEMA: _object(
        timestamp=_TIME,
        scalars=_array(_object(label=_TEXT, value={"type": ["number", "null"]})),
    ),
    STATE_SCHEMA: _object(timestamp=_TIME, state=_TEXT, reason=_TEXT, cause=_TEXT),
    LOG_SCHEMA: _object(
        timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER
    ),
    SCENE_SCHEMA: _object(deletions=_array(_DELETION), entities=_array(_ENTITY)),
    TRANSFORMS_SCHEMA: _object(transforms=_array(_TRANSFORM)),
}
"""JSON schemas by name."""


def schema_of(topic: str) -> str:
    """Return the name of the schema of a topic."""
    known = {
        LOG_TOPIC: LOG_SCHEMA,
        ARROWS_TOPIC: SCENE_SCHEMA,
        TAXELS_TOPIC: SCENE_SCHEMA,
        TRANSFORMS_TOPIC: TRANSFORMS_SCHEMA,
        PHASE_TOPIC: STATE_SCHEMA,
    }
    if topic.startswith((STATE_TOPIC, LABEL_TOPIC)):
        return STATE_SCHEMA
    return known.get(topic, SCALARS_SCHEMA)
