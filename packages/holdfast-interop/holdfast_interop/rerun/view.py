"""Entities of a hand in Rerun, and the layout of its views."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from holdfast.contact import ContactState
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast_interop.scene.hand_frames import WORLD, Frame, module_frame
from holdfast_interop.scene.taxel_arrows import SHORTEST_ARROW
from holdfast_interop.scene.tracks import ARROW_COLOURS

TIMELINE = "time"
"""Time since the start of the recording [s]."""
HAND, STATE_LANES, EVENT_LOG = "hand", "states", "events"
"""Roots of what is drawn in space, of the states, and of the log."""
SERIES_NAMES = {
    "force": "Force",
    "instability": "Instability",
    "stable_probability": "P(stable)",
    "slip_probability": "P(slip)",
    "slip_speed": "Slip speed [mm/s]",
    "true_slip_speed": "True slip speed [mm/s]",
}
"""Title of the plot of each quantity; its entities are `QUANTITY/FINGER`."""
ARROW_RADIUS, TAXEL_RADIUS = 0.0003, 0.0006
"""Radii of the arrows and of the dots [m]."""
DOT_COLOUR = (0.4, 0.4, 0.4)
EYE = np.array([0.24, 0.12, 0.12])
"""Where the hand is looked at from, relative to the middle of its modules [m]."""
NO_LABEL = "no label"


def entity(*parts: str) -> str:
    """Return the path of an entity; each part is one step of it, whatever its characters."""
    return str(rr.new_entity_path(list(parts)))


def time_column(times: Array, start: float) -> Any:  # noqa: ANN401
    """Return the column of times of an entity."""
    return rr.TimeColumn(TIMELINE, duration=times - start)


def frame_parts(frames: Iterable[Frame]) -> dict[str, tuple[str, ...]]:
    """Return the path of each frame below that of its parent; parents come first."""
    parts: dict[str, tuple[str, ...]] = {WORLD: (HAND,)}
    for frame in frames:
        parts[frame.name] = (*parts[frame.parent], frame.name.removeprefix(module_frame("")))
    return parts


def draw_hand(stream: Any, recording: Recording, frames: Sequence[Frame]) -> dict[str, str]:  # noqa: ANN401
    """Write the taxels as points, and the first pose of each frame; return a path by module."""
    parts = frame_parts(frames)
    for frame in frames:
        position, turned = frame.poses[0][:3], frame.poses[0][[4, 5, 6, 3]]
        pose = rr.Transform3D(translation=position, quaternion=rr.Quaternion(xyzw=turned))
        stream.log(entity(*parts[frame.name]), pose, static=len(frame.times) == 1)
    paths = {name: entity(*parts[module_frame(name)]) for name in recording.modules}
    for name, module in recording.modules.items():
        numbers = [f"{name} {k + 1}" for k in range(module.sensor.n_taxels)]
        points = rr.Points3D(
            module.sensor.positions, radii=TAXEL_RADIUS, colors=DOT_COLOUR,
            labels=numbers, show_labels=False,
        )  # fmt: skip
        stream.log(f"{paths[name]}/taxels", points, static=True)
    return paths


def name_states(stream: Any, lanes: Iterable[str]) -> None:  # noqa: ANN401
    """Write the colours of the states of each lane."""
    words = [state.value for state in ContactState]
    colours = [ARROW_COLOURS[state] for state in ContactState]
    for lane in lanes:
        style = rr.StateConfiguration(values=words, labels=words, colors=colours)
        stream.log(lane, style, static=True)


def long_enough(vectors: Array) -> Any:  # noqa: ANN401
    """Return which arrows (..., 3) [m] can be seen."""
    return np.linalg.norm(vectors, axis=-1) > SHORTEST_ARROW


def blueprint(quantities: Iterable[str], frames: Iterable[Frame]) -> Any:  # noqa: ANN401
    """Return the layout: the hand above the log, and the plots above the states."""
    modules = module_frame("")
    # All parents of modules stand at the origin of the world.
    middle = np.mean([f.poses[0][:3] for f in frames if f.name.startswith(modules)], axis=0)
    eye = rrb.EyeControls3D(position=middle + EYE, look_target=middle, eye_up=(0.0, 0.0, 1.0))
    plots = [
        rrb.TimeSeriesView(origin=quantity, name=SERIES_NAMES[quantity]) for quantity in quantities
    ]
    left = rrb.Vertical(
        rrb.Spatial3DView(origin=HAND, name="Hand", eye_controls=eye),
        rrb.TextLogView(origin=EVENT_LOG, name="Events"),
        row_shares=[3, 1],
    )
    right = rrb.Vertical(*plots, rrb.StateTimelineView(origin=STATE_LANES, name="States"))
    return rrb.Blueprint(rrb.Horizontal(left, right), collapse_panels=True)
