"""A synthetic grasp with known states: forces on flat patches, and poses of the object."""

import numpy as np
from scipy.spatial.transform import Rotation

from holdfast.contact import TIME_TOLERANCE
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor

PATCH = sensor("uskin-4x4")
RATE = 100.0
DURATION = 12.0
CLOSING, LOCKED, PUSH, PUSHED, RELEASE, FREE = 2.0, 3.0, 6.0, 6.8, 9.0, 9.5
GRIP = 4000.0
NOISE = 2.0
SPANS = (
    ("NO_CONTACT", 0.0, CLOSING),
    ("UNSTABLE", CLOSING, LOCKED),
    ("STABLE", LOCKED, PUSH),
    ("UNSTABLE", PUSH, PUSHED),
    ("STABLE", PUSHED, RELEASE),
    ("UNSTABLE", RELEASE, FREE),
    ("NO_CONTACT", FREE, DURATION),
)
"""Labels that a careful person would draw: state, start and end [s]."""


def clock(start=0.0, rate=RATE):
    return start + np.arange(round(DURATION * rate)) / rate


def profile(times, push=0.2):
    """Force of a finger over the grip force: (n, 3)."""
    knots = [0, CLOSING, LOCKED, RELEASE, FREE, DURATION]
    normal = np.interp(times, knots, [0, 0, 1, 1, 0, 0])
    inside = (times >= PUSH) & (times < PUSHED)
    shear = push * np.where(inside, np.sin(2 * np.pi * (times - PUSH) / 0.4), 0.0)
    return np.stack([shear, np.zeros_like(times), normal + shear / 2], axis=1)


def module(times, force, seed=0, scale=1.0):
    """Readings of a patch with an evenly distributed force (n, 3) and noise."""
    noise = np.random.default_rng(seed).normal(0, NOISE, (len(times), PATCH.n_taxels, 3))
    readings = force[:, None, :] / PATCH.n_taxels + noise
    return Tactile(PATCH, times, 1000 + scale * readings)


def grasp(start=0.0, scale=1.0, push=0.2, rate=RATE, fingers=("thumb", "index"), **more):
    """Recording of the whole grasp; all fingers feel the push."""
    times = clock(rate=rate)
    modules = {
        name: module(times + start, GRIP * profile(times, push), seed, scale)
        for seed, name in enumerate(fingers)
    }
    return Recording("made-up", modules, **more)


def slide(times, moves=((CLOSING, LOCKED), (PUSH, PUSHED)), speed=0.02):
    """Distance (n,) that the object has slid, at a constant speed [m/s] during the moves [m]."""
    rate = np.zeros_like(times)
    for start, end in moves:
        rate[(times >= start) & (times < end)] = speed
    return np.cumsum(rate) * (times[1] - times[0])


def poses(times, way, turn=None, jitter=0.0, seed=0):
    """Poses (n, 7) of the object, at x = `way` [m], turned about z by `turn` [rad]."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(
        np.outer(np.zeros_like(times) if turn is None else turn, [0, 0, 1])
        + rng.normal(0, jitter * 10, (len(times), 3))
    )
    position = np.stack([way, np.zeros_like(way), 0.05 + np.zeros_like(way)], axis=1)
    position = position + rng.normal(0, jitter, position.shape)
    return np.concatenate([position, np.roll(turns.as_quat(), 1, axis=1)], axis=1)


def moved(pose, rotation, translation):
    """The same poses in another world frame."""
    turned = rotation * Rotation.from_quat(np.roll(pose[:, 3:], -1, axis=1))
    position = rotation.apply(pose[:, :3]) + translation
    return np.concatenate([position, np.roll(turned.as_quat(), 1, axis=1)], axis=1)


def tracked(object_pose, tip_pose=None, start=0.0, **more):
    """Recording of the grasp with poses of the object and of fingertips, fixed by default."""
    times = clock()
    if tip_pose is None:
        tip_pose = poses(times, np.zeros_like(times))
    fingers = {name: {"tip_pose": tip_pose} for name in ("thumb", "index")}
    truth = Truth(times + start, {"object_pose": object_pose}, fingers)
    return grasp(start, truth=truth, **more)


def drawn(labels):
    """State, start and end of every span of one state, in order of time; labels that touch join."""
    spans = []
    for label in sorted(labels, key=lambda label: label.start):
        if spans and spans[-1][0] == label.state and label.start - spans[-1][2] <= TIME_TOLERANCE:
            spans[-1] = (spans[-1][0], spans[-1][1], label.end)
        else:
            spans.append((str(label.state), label.start, label.end))
    return spans


def check(labels, within, spans=SPANS, start=0.0):
    """Check that the labels have those spans, with every edge within a tolerance [s].

    Touching labels of one state are one span: a slip and the disturbance around it.
    """
    found = drawn(labels)
    assert [state for state, _, _ in found] == [state for state, _, _ in spans]
    for (_, begin, end), (_, first, last) in zip(found, spans, strict=True):
        assert abs(begin - start - first) <= within
        assert abs(end - start - last) <= within
