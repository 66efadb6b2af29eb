"""A hand, a sensor, an object and a hold, drawn from ranges: what one recording is made from."""

import tomllib
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array
from holdfast.twin.grasp import PAD_MIDDLE
from holdfast.twin.objects import SHAPES, GraspObject, make_object
from holdfast.twin.skin import Skin, Three
from holdfast.twin.surface import curved_fingertip
from holdfast.twin.uskin_readout import UskinParameters
from holdfast_lab.randomized.gripper import Drives, PadLayout, flat_patch, pad_layout
from holdfast_lab.randomized.palm import log_uniform, uniform

SENSOR_KINDS = ("uskin-curved", "uskin-4x4", "uskin-4x6", "anyskin", "papillarray", "grid-3x3")
"""Sensors of randomized hands."""
_PITCH = {"uskin-4x4": 4.7e-3, "uskin-4x6": 7.2e-3, "anyskin": 7e-3, "papillarray": 7e-3}
_SPREAD = {"uskin-4x4": 2.4e-3, "uskin-4x6": 3.0e-3, "anyskin": 6e-3, "papillarray": 1.5e-3}
"""How far a force spreads in the silicone, standard deviation [m]: the magnetic skins are thick
beside their pitch; pillars stand alone."""


_SCANNED = ("uskin-curved", "uskin-4x4", "uskin-4x6", "anyskin", "grid-3x3")
"""Sensors of magnetometers, which are read in turn; pillars are read at once."""
_WEAK = ("anyskin", "grid-3x3")
"""Single magnetometers, whose noise may be large beside what the skin moves them."""
MEASURED = (
    "scan", "filter", "noise", "vibration",
    "colour", "steps", "updates", "stamps", "carry", "person",
)  # fmt: skip
"""Mechanisms of `measured.toml`: taxels are read in turn; readings are averaged; the noise is that
of real skins; the arm vibrates more while it moves; noise is slow and wanders; readings have
coarser steps, and some taxels no noise; rows repeat until the sensor updates; stamps are unsteady,
with gaps; an arm carries the hand all the time; a person does."""


@dataclass(frozen=True)
class StreamEffects:
    """Changes of the readings between a sensor and the rows of a recording.

    Attributes:
        rows_per_update: rows in which an update of the sensor is shown; 1: it updates each row.
        update_phase: of the updates, from 0 to 1.
        jitter: standard deviation of a stamp, in periods.
        gap_rate: of gaps in which rows are lost [1/s].
        gap: range of their length [s].
    """

    rows_per_update: float = 1.0
    update_phase: float = 0.0
    jitter: float = 0.0
    gap_rate: float = 0.0
    gap: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class SensorDraw:
    """The sensor of a hand.

    Attributes:
        sensor: layout, rate and unit.
        parameters: of the readout.
        stream: what comes between the sensor and the rows of a recording.
    """

    sensor: Sensor
    parameters: UskinParameters
    stream: StreamEffects = StreamEffects()


@cache
def ranges() -> dict[str, dict[str, Any]]:
    """Return the ranges of `ranges.toml`, by section."""
    text = resources.files("holdfast_lab.randomized").joinpath("ranges.toml").read_text("utf-8")
    return tomllib.loads(text)


@cache
def measured_ranges() -> dict[str, dict[str, Any]]:
    """Return the ranges of `measured.toml`, by mechanism."""
    text = resources.files("holdfast_lab.randomized").joinpath("measured.toml").read_text("utf-8")
    return tomllib.loads(text)


def draw_sensor(generator: np.random.Generator, kind: str) -> SensorDraw:
    """Draw a sensor of a kind: rate, unit, gains, cross-talk, noise, lag and drift."""
    span = ranges()["sensor"]
    template = _sensor(kind)
    newtons = kind == "papillarray" or generator.random() < span["newtons"]
    rate = round(log_uniform(generator, span["rate"]), 1)
    scale = log_uniform(generator, span["scale"])
    base = UskinParameters()
    lags = (uniform(generator, span["lag_share"]), 0.5 * uniform(generator, span["lag_share"]))
    drift = uniform(generator, span["drift"])
    parameters = replace(
        base,
        spread=_SPREAD.get(kind, 2.8e-3),
        gain_spread=uniform(generator, span["gain_spread"]),
        cross_talk=uniform(generator, span["cross_talk"]),
        counts_per_newton=_scaled(base.counts_per_newton, scale),
        limits=(2.5, 2.5, 12.0) if kind in ("anyskin", "papillarray") else base.limits,
        lag_shares=lags,
        lag_times=(uniform(generator, span["lag_time"]), 2.0),
        thermal_counts=_scaled(base.thermal_counts, drift * scale),
        noise_counts=log_uniform(generator, span["noise"]) * base.noise_counts,
    )
    ends = None if newtons else template.range
    made = replace(template, rate=rate, unit="N" if newtons else "count", range=ends)
    return SensorDraw(made, parameters)


def with_measured(
    drawn: SensorDraw, kind: str, mechanisms: Collection[str], generator: np.random.Generator
) -> SensorDraw:
    """Draw how a sensor is read: each mechanism takes the same draws, with or without the others.

    Args:
        drawn: the sensor, as `draw_sensor` returns it.
        kind: of the sensor.
        mechanisms: from `MEASURED`.
        generator: of all that is drawn.
    """
    # All is drawn before it is asked what is used: a mechanism leaves the draws of the others.
    span, period = measured_ranges(), 1 / drawn.sensor.rate
    time = period * uniform(generator, span["scan"]["time"])
    line = int(generator.integers(span["scan"]["line"][0], span["scan"]["line"][1] + 1))
    averages = generator.random() < span["filter"]["share"]
    n_averaged = max(1, round(uniform(generator, span["filter"]["time"]) / period))
    normal, weak = (log_uniform(generator, span["noise"][name]) for name in ("normal", "weak"))
    changes: dict[str, Any] = {}
    if "scan" in mechanisms and kind in _SCANNED:
        changes |= {"scan_time": time, "scan_line": line}
    if "filter" in mechanisms and averages:
        changes["n_averaged"] = n_averaged
    if "noise" in mechanisms:
        noise = drawn.parameters.noise_counts * (weak if kind in _WEAK else 1.0)
        changes |= {"noise_by_axis": (1.0, 1.0, normal), "noise_counts": noise}
    # Slow noise and drift.
    colour = span["colour"]
    is_slow = generator.random() < colour["share"]
    slow, walk = uniform(generator, colour["slow"]), log_uniform(generator, colour["walk"])
    slow_time = log_uniform(generator, colour["time"])
    if "colour" in mechanisms:
        share = slow if is_slow else 0.0
        changes |= {"slow_share": share, "slow_time": slow_time, "walk": walk}
    # The step of the readings is relative to their noise, which another mechanism may have changed.
    ratio = log_uniform(generator, span["steps"]["ratio"])
    has_still = generator.random() < span["steps"]["still_sensors"]
    if "steps" in mechanisms:
        noise = changes.get("noise_counts", drawn.parameters.noise_counts)
        share = span["steps"]["still_taxels"] if has_still else 0.0
        changes |= {"step": max(1, round(noise / ratio)), "still_share": share}
    read = replace(drawn.parameters, **changes)
    return replace(drawn, parameters=read, stream=_stream(mechanisms, generator))


def _stream(mechanisms: Collection[str], generator: np.random.Generator) -> StreamEffects:
    """Draw what comes between a sensor and the rows of a recording."""
    updates, stamps = measured_ranges()["updates"], measured_ranges()["stamps"]
    is_slow = generator.random() < updates["share"]
    rows, phase = log_uniform(generator, updates["rows"]), float(generator.random())
    is_unsteady = generator.random() < stamps["share"]
    jitter, gap_rate = (log_uniform(generator, stamps[name]) for name in ("jitter", "gap_rate"))
    effects = StreamEffects()
    if "updates" in mechanisms and is_slow:
        effects = replace(effects, rows_per_update=rows, update_phase=phase)
    if "stamps" in mechanisms and is_unsteady:
        low, high = stamps["gap"]
        effects = replace(effects, jitter=jitter, gap_rate=gap_rate, gap=(low, high))
    return effects


def draw_moving_vibration(generator: np.random.Generator) -> float:
    """Draw the vibration of an arm that moves, rms [m/s^2]."""
    return log_uniform(generator, measured_ranges()["vibration"]["moving"])


def _scaled(values: Three, factor: float) -> Three:
    x, y, z = values
    return factor * x, factor * y, factor * z


def _sensor(kind: str) -> Sensor:
    if kind != "grid-3x3":
        return sensor(kind)
    x, y = (grid.ravel() for grid in np.meshgrid([-1.0, 0, 1], [1.0, 0, -1]))
    positions = 6e-3 * np.column_stack([x, y, np.zeros(9)])
    return Sensor(
        "grid-3x3", positions, np.tile(np.eye(3), (9, 1, 1)), np.array([0.0, 0.0, 1.0]), rate=100.0
    )


def draw_drives(generator: np.random.Generator) -> Drives:
    """Draw the drives of a hand."""
    span = ranges()["hand"]
    return Drives(
        stiffness=log_uniform(generator, span["drive_stiffness"]),
        side_stiffness=log_uniform(generator, span["side_stiffness"]),
        damping_ratio=uniform(generator, span["damping_ratio"]),
        mass=uniform(generator, span["pad_mass"]),
        noise=uniform(generator, span["drive_noise"]),
        glitch_rate=uniform(generator, span["glitch_rate"]),
        glitch_size=uniform(generator, span["glitch_size"]),
    )


def draw_skin(generator: np.random.Generator) -> Skin:
    """Draw the stiffness of the skin."""
    stiffness = log_uniform(generator, ranges()["hand"]["skin_stiffness"])
    return Skin(stiffness=stiffness)


def draw_object(generator: np.random.Generator, grip: float, n_opposite: int) -> GraspObject:
    """Draw an object that the grip can hold: its friction holds three times its weight or more.

    Args:
        generator: of all that is drawn.
        grip: of each finger opposite the thumb [N].
        n_opposite: such fingers.
    """
    span = ranges()["object"]
    static = uniform(generator, span["friction"])
    # Friction acts on both sides, mu (N_thumb + N_fingers) = 2 mu n N, and holds 3 m g.
    largest = 2 * static * grip * n_opposite / (3 * 9.81)
    low, high = span["mass"]
    mass = log_uniform(generator, (low, max(min(high, largest), 1.01 * low)))
    shape = str(generator.choice(list(SHAPES)))
    wide, tall = uniform(generator, span["size"]), uniform(generator, span["height"])
    other = float(np.clip(wide * generator.uniform(0.85, 1.2), *span["size"]))
    sizes = {
        "sphere": [wide],
        "box": [wide, other, tall, 0.003],
        "cylinder": [wide, tall, 0.003],
        "capsule": [wide, max(tall, 1.1 * wide)],
        "hexagon": [wide, tall, 0.003],
        "frustum": [wide, other, tall, 0.003],
    }
    row = {
        "shape": shape,
        "size": sizes[shape],
        "mass": mass,
        "friction": [static, static * float(generator.uniform(0.7, 1.0))],
        "texture": [log_uniform(generator, span["texture"]), float(generator.uniform(1e-3, 3e-3))],
        "finger_height": 0.0,
        "yaw": 0.0,
    }
    return make_object(shape, row)


def draw_layout(
    generator: np.random.Generator, kind: str, item: GraspObject, n_pads: int
) -> PadLayout:
    """Place the pads round the object, at a height over its centre of mass.

    Raises:
        ValueError: a pad does not reach the object.
    """
    if kind == "uskin-curved":
        surface, normal, point = curved_fingertip(), np.array([1.0, 0.0, 0.0]), np.array(PAD_MIDDLE)
    else:
        template = _sensor(kind)
        surface = flat_patch(template.positions, _PITCH.get(kind, 6e-3))
        normal, point = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    room = max(item.half_height - (0.012 if n_pads == 2 else 0.034), 0.0)
    height = item.middle + room * uniform(generator, ranges()["object"]["off_centre"])
    return pad_layout(surface, normal, point, n_pads, item, height)


def random_rotation(generator: np.random.Generator) -> Array:
    """Draw a rotation matrix, uniformly."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.random(random_state=generator).as_matrix())
