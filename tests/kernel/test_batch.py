"""The functions of the extension on whole arrays: threads, and arrays that do not fit."""

import array
import ctypes

import numpy as np
import pytest

from holdfast.kernel import batch
from kernel.extension import extension

N = 5000
WINDOW = 14
FORCE = np.random.default_rng(0).normal(size=(N, 3))
READINGS = np.random.default_rng(1).normal(size=(40, 5, 3))
BASELINE = np.random.default_rng(2).normal(size=(5, 3))
ROTATIONS = np.random.default_rng(3).normal(size=(5, 3, 3))


def features(force=FORCE, out=None, window=WINDOW, first=0, stop=None):
    last = len(force) if stop is None else stop
    out = np.zeros((N if stop is not None else last, 6)) if out is None else out
    extension.haar_features(force, out, first, last, window)
    return out


def forces(readings=READINGS, baseline=BASELINE, rotations=ROTATIONS, out=None, first=0, stop=None):
    out = np.zeros((len(readings), 3)) if out is None else out
    last = len(readings) if stop is None else stop
    extension.fingertip_force(readings, baseline, rotations, out, first, last)
    return out


@pytest.mark.parametrize("window", [2, 6, 14, 32, 64])
@pytest.mark.parametrize("n", [0, 1, 13, 14, 383, 384, 397, 398, N])
def test_any_number_of_threads_gives_the_same_features(n, window):
    expected = np.full((n, 6), 7.0)
    batch.fill_haar_features(FORCE[:n], window, expected, n_threads=1)
    for n_threads in (2, 3, 5):
        found = np.full((n, 6), 8.0)
        batch.fill_haar_features(FORCE[:n], window, found, n_threads)
        assert np.array_equal(found, expected, equal_nan=True)


def test_large_arrays_are_computed_in_threads(monkeypatch):
    calls = []
    monkeypatch.setattr(batch, "SERIAL_BYTES", 24 * 100)
    monkeypatch.setattr(batch, "ThreadPoolExecutor", lambda n: calls.append(n) or POOL(n))
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    out = np.empty((101, 6))
    batch.fill_haar_features(FORCE[:100], WINDOW, out[:100])
    assert calls == []
    batch.fill_haar_features(FORCE[:101], WINDOW, out)
    assert calls == [3]


POOL = batch.ThreadPoolExecutor


@pytest.mark.parametrize(("given", "expected"), [("1", 1), ("0", 1), ("5", 5)])
def test_the_limit_of_threads(monkeypatch, given, expected):
    monkeypatch.setenv("OMP_NUM_THREADS", given)
    assert batch.max_threads() == expected
    for other in ("4,2", "²"):
        monkeypatch.setenv("OMP_NUM_THREADS", other)
        assert batch.max_threads() >= 1


def read_only(values):
    values = values.copy()
    values.flags.writeable = False
    return values


class Liar:
    """An object that says of itself that it is an array."""

    shape = (N, 3)
    dtype = np.dtype(float)

    @property
    def __array_interface__(self):
        return {"shape": (N, 3), "typestr": "<f8", "data": (8, False), "version": 3}

    def __len__(self):
        return N


unaligned = np.empty(N * 24 + 1, dtype=np.uint8)[1:].view(np.float64).reshape(N, 3)
unaligned[:] = FORCE
REFUSED = {
    "float32": (FORCE.astype(np.float32), TypeError, "force"),
    "int64": (FORCE.astype(np.int64), TypeError, "force"),
    "objects": (FORCE.astype(object), TypeError, "force"),
    "complex": (FORCE.astype(complex), TypeError, "force"),
    "long double": (FORCE.astype("g"), TypeError, "force"),
    "bytes in the other order": (FORCE.astype(FORCE.dtype.newbyteorder()), TypeError, "force"),
    "bytes": (b"\0" * 24, TypeError, "force"),
    "records": (np.zeros((N, 3), dtype=[("x", "f8")]), TypeError, "force"),
    "every second row": (np.vstack([FORCE] * 2)[::2], ValueError, "contiguous"),
    "columns first": (np.asfortranarray(FORCE), ValueError, "contiguous"),
    "backwards": (FORCE[::-1], ValueError, "contiguous"),
    "one row again and again": (np.broadcast_to(FORCE[0], (N, 3)), ValueError, "contiguous"),
    "one axis": (array.array("d", [1.0] * 3), ValueError, "force"),
    "three axes": (FORCE[None], ValueError, "force"),
    "a number": (np.array(1.0), ValueError, "force"),
    "two columns": (FORCE[:, :2].copy(), ValueError, "force"),
    "not aligned": (unaligned, ValueError, "force"),
    "a list": (FORCE.tolist(), TypeError, "bytes-like"),
    "None": (None, TypeError, "bytes-like"),
    "an object that lies": (Liar(), TypeError, "bytes-like"),
    "numbers of C": ((ctypes.c_double * 3 * 2)(), ValueError, "out"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_array_that_does_not_fit_is_refused(name):
    given, error, message = REFUSED[name]
    with pytest.raises(error, match=message):
        features(given, out=np.zeros((N, 6)), stop=1)


@pytest.mark.parametrize(
    ("out", "error", "message"),
    [
        (read_only(np.zeros((N, 6))), ValueError, "read-only"),
        (np.zeros((N, 5)), ValueError, "out"),
        (np.zeros((N - 1, 6)), ValueError, "out"),
        (np.zeros((N, 12))[:, ::2], ValueError, "not C-contiguous"),
        (np.zeros((N, 6), dtype=np.float32), TypeError, "out"),
    ],
)
def test_a_result_that_does_not_fit_is_refused(out, error, message):
    with pytest.raises(error, match=message):
        features(out=out)


def test_arrays_that_share_memory_are_refused():
    memory = np.zeros(N * 8)
    force, out = memory[: 3 * N].reshape(N, 3), memory[2 * N :].reshape(N, 6)
    with pytest.raises(ValueError, match="force and out"):
        features(force, out)


@pytest.mark.parametrize(
    ("window", "first", "stop"),
    [(0, 0, 1), (-2, 0, 1), (3, 0, 1), (14, -1, 1), (14, 2, 1), (14, 0, N + 1)],
)
def test_numbers_out_of_range_are_refused(window, first, stop):
    with pytest.raises(ValueError) as raised:
        features(window=window, first=first, stop=stop)
    wrong = f"window {window}" if window != WINDOW else f"samples {first} to {stop} of {N}"
    assert str(raised.value) == f"{wrong} given"


@pytest.mark.parametrize(("first", "stop"), [(-1, 1), (2, 1), (0, 41)])
def test_parts_out_of_range_are_refused(first, stop):
    with pytest.raises(ValueError, match=f"samples {first} to {stop}"):
        forces(first=first, stop=stop)


@pytest.mark.parametrize("number", [2**70, 1.5, "14", None])
def test_other_types_of_numbers_are_refused(number):
    for name in ("window", "first", "stop"):
        if name == "stop" and number is None:
            continue  # the default of this test
        with pytest.raises((TypeError, OverflowError)):
            features(**{name: number})


@pytest.mark.parametrize("n", [0, 1, 4, 6])
def test_the_number_of_arguments_is_checked(n):
    arguments = (FORCE, np.zeros((N, 6)), 0, N, WINDOW, None)
    with pytest.raises(TypeError, match=f"{n} given"):
        extension.haar_features(*arguments[:n])
    with pytest.raises(TypeError, match="6 arguments"):
        extension.fingertip_force(*arguments[: n - 1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"baseline": BASELINE[:4]}, "baseline"),
        ({"baseline": BASELINE[:, :2].copy()}, "baseline"),
        ({"rotations": ROTATIONS[:4]}, "rotations"),
        ({"rotations": ROTATIONS[:, :2].copy()}, "rotations"),
        ({"rotations": ROTATIONS[..., :1].copy()}, "rotations"),
        ({"readings": READINGS[..., :1].copy()}, "readings"),
        ({"readings": READINGS[0]}, "readings"),
        ({"out": np.zeros((40, 4))}, "out"),
        ({"out": READINGS.reshape(-1, 3)[:40]}, "readings and out share memory"),
        ({"out": np.zeros((39, 3))}, "out"),
    ],
)
def test_taxels_that_do_not_fit_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        forces(**arguments)
