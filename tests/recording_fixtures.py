import random

import numpy as np
import pytest
from hypothesis import strategies as st

from holdfast.contact import Cause, ContactState
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import Sensor, sensor

NUMBERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
FLOATS = ("float32", "float64")
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=8)
NAMES = TEXT.filter(bool)


@pytest.fixture(scope="session")
def make_recording():
    """A hand of two modules with their own rates, labels, truth, markers and media."""

    def make(n=900, seed=0, **fields):
        rng = np.random.default_rng(seed)
        times = np.arange(n) / 150
        thumb = Tactile(
            sensor("uskin-4x4"),
            times,
            rng.integers(0, 65535, (n, 16, 3)).astype(np.uint16),
            labels=(
                Label(0.0, 0.1, ContactState.NO_CONTACT),
                Label(0.1, 0.2, ContactState.UNSTABLE, Cause.CLOSING, "hand", 0.5, "ä"),
                Label(0.2, times[-1], ContactState.STABLE),
            ),
        )
        readings = rng.normal(size=(n // 2, 5, 3)).astype(np.float32)
        readings[3, 2] = np.nan
        index = Tactile(sensor("anyskin"), times[: n // 2] * 2 + 0.001, readings, "N")
        n_rows = n // 3
        truth = Truth(
            times[:n_rows] * 3,
            {
                "phase": np.array(["free", "löcked"])[np.arange(n_rows) % 2],
                "object_pose": rng.normal(size=(n_rows, 7)),
                "matrix": rng.normal(size=(n_rows, 2, 2)),
            },
            {"thumb": {"slip_speed": rng.normal(size=n_rows), "slides": np.arange(n_rows) % 2 < 1}},
        )
        given = {
            "name": "can_1",
            "modules": {"thumb": thumb, "index/1": index},
            "metadata": {"object": "cän", "object_mass": 0.3, "case": None, "repeat": [1, 2]},
            "truth": truth,
            "markers": ((0.2, "grasped"), (1.5, "ü")),
            "media": (("video.mp4", 0.25),),
        }
        return Recording(**(given | fields))

    return make


@pytest.fixture(scope="session")
def assert_same():
    """Fails where two recordings differ in anything but what `but` names."""

    def check(got, want, but=()):
        assert dict(got.metadata) == dict(want.metadata)
        assert list(got.modules) == list(want.modules)
        assert got.media == want.media
        if "name" not in but:
            assert got.name == want.name
        if "markers" not in but:
            assert got.markers == want.markers
        for name, module in want.modules.items():
            _assert_same_module(got.modules[name], module, but)
        assert (got.truth is None) == (want.truth is None)
        if want.truth is not None:
            _assert_same_truth(got.truth, want.truth)
        assert got.digest == want.digest

    return check


def _assert_same_module(got, want, but):
    assert got.sensor == want.sensor
    assert got.unit == want.unit
    _assert_same_array(got.times, want.times)
    _assert_same_array(got.readings, want.readings)
    if "labels" not in but:
        assert got.labels == want.labels


def _assert_same_truth(got, want):
    _assert_same_array(got.times, want.times)
    assert list(got.hand) == list(want.hand)
    assert list(got.fingers) == list(want.fingers)
    for name, array in want.hand.items():
        _assert_same_array(got.hand[name], array)
    for finger, arrays in want.fingers.items():
        assert list(got.fingers[finger]) == list(arrays)
        for name, array in arrays.items():
            _assert_same_array(got.fingers[finger][name], array)


def _assert_same_array(got, want):
    if want.dtype.kind == "U":
        assert got.dtype.kind == "U"
        assert got.tolist() == want.tolist()
        return
    assert got.dtype == want.dtype
    assert got.shape == want.shape
    assert got.tobytes() == want.tobytes()


@pytest.fixture(scope="session")
def recordings():
    """Recordings of every number type, rate and length, for hypothesis."""
    return _recordings()


@st.composite
def _recordings(draw):
    names = draw(st.lists(NAMES, min_size=1, max_size=3, unique=True))
    modules = {name: draw(_tactile()) for name in names}
    if not any(module.n_samples for module in modules.values()):
        modules[names[0]] = draw(_tactile(min_size=1))
    return Recording(
        draw(NAMES),
        modules,
        draw(st.dictionaries(TEXT, TEXT | st.integers(-9, 9) | st.none(), max_size=3)),
        draw(st.none() | _truth(names)),
        tuple(draw(st.lists(st.tuples(st.floats(-9, 9), TEXT), max_size=2))),
        tuple(draw(st.lists(st.tuples(TEXT, st.floats(-9, 9)), max_size=2))),
    )


@st.composite
def _times(draw, min_size=0):
    start = draw(st.floats(-1e3, 1e9))
    steps = draw(st.lists(st.sampled_from([1e-3, 0.01, 0.3, 70.0]), min_size=min_size, max_size=40))
    return start + np.cumsum(steps)


@st.composite
def _tactile(draw, min_size=0):
    times = draw(_times(min_size))
    readings = draw(_values((len(times), 2, 3), NUMBERS + FLOATS))
    flat = Sensor("two", np.eye(3)[:2], np.tile(np.eye(3), (2, 1, 1)), np.array([0, 0, 1.0]), 100.0)
    labels = ()
    if len(times) > 1 and draw(st.booleans()):
        labels = (Label(times[0], times[-1], draw(st.sampled_from(list(ContactState)[1:]))),)
    return Tactile(flat, times, readings, draw(st.sampled_from(["count", "N"])), labels)


@st.composite
def _values(draw, shape, numbers):
    number = draw(st.sampled_from(numbers))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    if number == "str":
        return np.array([f"ö{k % 3}" * (k % 4) for k in range(int(np.prod(shape)))], "U8").reshape(
            shape
        )
    values = np.frombuffer(rng.bytes(int(np.prod(shape)) * np.dtype(number).itemsize), number)
    return (values if number != "bool" else values.view("u1") % 2 == 0).reshape(shape)


@st.composite
def _truth(draw, fingers):
    times = draw(_times())
    shapes = st.sampled_from([(), (3,), (2, 2)])
    arrays = [
        draw(_values((len(times), *draw(shapes)), (*NUMBERS, *FLOATS, "bool", "str")))
        for _ in range(3)
    ]
    return Truth(times, {"phase": arrays[0], "é b": arrays[1]}, {fingers[0]: {"x": arrays[2]}})


@pytest.fixture
def flipped():
    """Copies of some bytes, each with one bit flipped: half anywhere, half near the ends."""

    def copies(raw, n, seed=0):
        chance = random.Random(seed)
        for k in range(n):
            near = [chance.randrange(64), len(raw) - 1 - chance.randrange(min(4000, len(raw)))]
            offset = chance.randrange(len(raw)) if k % 2 else chance.choice(near)
            damaged = bytearray(raw)
            damaged[offset] ^= 1 << chance.randrange(8)
            yield offset, bytes(damaged)

    return copies
