from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.sensors.types import Array
from holdfast.twin.objects import (
    BUILT_IN_OBJECTS,
    GraspObject,
    distance_to,
    load_objects,
    solid,
)
from holdfast.twin.steps import probe

OBJECTS = load_objects()
SMOOTH = {name: replace(one, texture_amplitude=0.0) for name, one in OBJECTS.items()}
LINE = (
    'mug = {shape = "cylinder", size = [0.035, 0.05, 0.003], mass = 0.2, friction = [0.7, 0.6], '
    "texture = [1e-5, 2e-3], finger_height = 0.02, yaw = 0.1}"
)

names = st.sampled_from(sorted(OBJECTS))
coordinates = st.floats(-0.08, 0.08)
points = st.tuples(coordinates, coordinates, coordinates)


def middle_of(one: GraspObject) -> float:
    """Height of the middle in the object's frame [m]."""
    return one.foot[2] + one.half_height


def segments_distance(corners: list[tuple[float, float]], at: Array) -> float:
    """From a closed polygon in the plane, negative inside: by its sides, one by one."""
    best, inside = np.inf, True
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        start, side = np.array(a), np.array(b) - np.array(a)
        t = np.clip((at - start) @ side / (side @ side), 0, 1)
        best = min(best, float(np.linalg.norm(at - start - t * side)))
        inside &= bool(side[0] * (at - start)[1] - side[1] * (at - start)[0] >= 0)
    return -best if inside else best


def upright(flat: float, tall: float) -> float:
    """Distance from a body that is a shape in the plane, drawn out along z."""
    if max(flat, tall) <= 0:
        return max(flat, tall)
    return float(np.hypot(max(flat, 0), max(tall, 0)))


def naive_distance(one: GraspObject, point: tuple[float, float, float]) -> float:
    x, y, z = point[0], point[1], point[2] - middle_of(one)
    q, size = float(np.hypot(x, y)), one.size
    if one.shape in ("sphere", "capsule"):
        reach = one.half_height - size[0]
        return float(np.linalg.norm([x, y, z - np.clip(z, -reach, reach)])) - size[0]
    r, tall = size[-1], abs(z) - one.half_height + size[-1]
    if one.shape == "box":
        a, b = size[0] - r, size[1] - r
        flat = segments_distance([(-a, -b), (a, -b), (a, b), (-a, b)], np.array([x, y]))
        return upright(flat, tall) - r
    if one.shape == "hexagon":
        turns = np.radians(np.arange(30, 390, 60))
        corners = [
            ((size[0] - r) * 2 / np.sqrt(3) * np.array([np.cos(t), np.sin(t)])) for t in turns
        ]
        return upright(segments_distance([tuple(c) for c in corners], np.array([x, y])), tall) - r
    foot, top, h = (size[0], size[0], size[1]) if one.shape == "cylinder" else size[:3]
    slope = (top - foot) / (2 * h)
    inset, high = r * np.hypot(1, slope), h - r
    low, up = foot + slope * r - inset, top - slope * r - inset
    corners = [(-low, -high), (low, -high), (up, high), (-up, high)]
    return segments_distance(corners, np.array([q, z])) - r


@pytest.mark.slow
@settings(max_examples=300)
@given(name=names, point=points)
def test_same_as_the_naive_distance(name: str, point: tuple[float, float, float]) -> None:
    expected = naive_distance(SMOOTH[name], point)
    assert float(distance_to(SMOOTH[name], point)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
@settings(max_examples=300)
@given(
    name=names, angle=st.floats(-3.1, 3.1), height=st.floats(-0.9, 0.9), d=st.floats(-2.5e-3, 9e-3)
)
def test_the_gradient_is_that_of_the_distance(
    name: str, angle: float, height: float, d: float
) -> None:
    """Near the surface, where fingertips are: inside by less than the rounding too."""
    one, packed = OBJECTS[name], solid(OBJECTS[name])
    point = np.array([np.cos(angle), np.sin(angle), 0.0]) * 0.06
    point[2] = height * one.half_height + middle_of(one)
    far, *normal = probe(packed, *point)
    point -= (far - d) * np.array(normal)
    _, *gradient = probe(packed, *point)
    steps = 1e-6 * np.eye(3)
    numeric = [
        (probe(packed, *(point + s))[0] - probe(packed, *(point - s))[0]) / 2e-6 for s in steps
    ]
    np.testing.assert_allclose(gradient, numeric, atol=1e-3)


@pytest.mark.parametrize("name", sorted(OBJECTS))
def test_sizes_are_where_the_surface_is(name: str) -> None:
    one = SMOOTH[name]
    middle = middle_of(one)
    ends = [
        [one.radius, 0, middle] if one.shape != "frustum" else [0, 0, one.foot[2]],
        [-one.radius, 0, middle] if one.shape != "frustum" else [0, 0, one.foot[2]],
        one.foot,
        [0, 0, middle + one.half_height],
    ]
    np.testing.assert_allclose(distance_to(one, ends), 0, atol=1e-12)


@pytest.mark.parametrize("name", sorted(OBJECTS))
def test_inertia_by_random_points(name: str) -> None:
    """Another quadrature, and the centre of mass is the origin."""
    one = SMOOTH[name]
    rng = np.random.default_rng(1)
    box = np.array([0.04, 0.04, one.half_height * 1.01])
    some = rng.uniform(-1, 1, (400_000, 3)) * box + [0, 0, middle_of(one)]
    inside = some[distance_to(one, some) < 0]
    np.testing.assert_allclose(inside.mean(axis=0), 0, atol=5e-4)
    square = (inside**2).mean(axis=0)
    np.testing.assert_allclose(one.inertia, one.mass * (square.sum() - square), rtol=0.01)


def test_a_line_makes_a_new_object(tmp_path: Path) -> None:
    path = tmp_path / "more.toml"
    path.write_text(BUILT_IN_OBJECTS.read_text("utf-8") + LINE, "utf-8")
    objects = load_objects(path)
    assert list(objects) == [*OBJECTS, "mug"]
    assert (objects["mug"].radius, objects["mug"].half_height) == (0.035, 0.05)
    assert objects["mug"].yaw == 0.1
    assert objects["can"].inertia.tobytes() == OBJECTS["can"].inertia.tobytes()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass", "weight", "'weight'; there are shape, size, mass"),
        (", yaw = 0.1", "", "'yaw'"),
        ("cylinder", "torus", "'torus'; there are sphere"),
        ('"cylinder"', "3", "no shape 3"),
        (", 0.003]", "]", "size"),
        ("mass = 0.2", "mass = [0.2, 1]", "mass"),
        *(("mass = 0.2", f"mass = {mass}", "mass") for mass in ("-1", "nan", "true", "'a'")),
        ("0.7, 0.6", "0.6, 0.7", "friction"),
        ("1e-5, 2e-3", "5e-4, 2e-3", "texture"),
        ("0.05, 0.003", "0.05, 0.04", "size"),
        ("[0.035", "[0.06", "size"),
        ('"cylinder", size = [0.035, 0.05, 0.003]', '"capsule", size = [0.035, 0.03]', "size"),
    ],
)
def test_an_invalid_line_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "t.toml"
    assert old in LINE
    path.write_text(LINE.replace(old, new), "utf-8")
    with pytest.raises(ValueError, match=f"mug: .*{message}"):
        load_objects(path)


def test_a_file_that_is_not_a_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.toml"
    for text in ("mug = ", "\nmug" + 17 * ".a", "", "mug = 3"):
        path.write_text(text, "utf-8")
        with pytest.raises(ValueError, match=r"t\.toml"):
            load_objects(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match=r"t\.toml"):
        load_objects(path)
    with pytest.raises(FileNotFoundError):
        load_objects(tmp_path / "none.toml")
