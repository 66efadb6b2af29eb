"""The stream of the extension: chunks, threads, and arguments that do not fit."""

import copy
import pickle
import re
import threading

import numpy as np
import pytest

from holdfast.detection.streams import FeatureStream
from holdfast.kernel import _extension
from kernel.random_streams import random_plan, random_rows

N = 400
TEXT_OF_AN_ARRAY = "float64 expected, the format f given"


def made(seed=0, n=N):
    """A stream, and samples of it as the arrays that `advance` takes."""
    rng = np.random.default_rng(seed)
    plan = random_plan(rng)
    readings, present, times = map(np.array, zip(*random_rows(rng, plan, n), strict=True))
    return FeatureStream(plan), [np.ascontiguousarray(readings), present, times]


def advanced(c, stream, samples):
    n, n_fingers, n_features = (*samples[1].shape, stream.plan.width)
    out = [np.full((n, n_fingers, n_features), 7.0), np.full((n, n_fingers), 7.0)]
    c.advance(*samples, *out)
    return out


def assert_same(found, expected):
    for a, b in zip(found, expected, strict=True):
        assert np.array_equal(a, b, equal_nan=True)


def test_any_chunking_gives_the_same_bits():
    stream, samples = made(3)
    whole, c, parts = advanced(stream.start(), stream, samples), stream.start(), []
    for start, stop in ((0, 0), (0, 1), (1, 150), (150, 150), (150, N)):
        parts.append(advanced(c, stream, [values[start:stop] for values in samples]))
    assert_same([np.concatenate(part) for part in zip(*parts, strict=True)], whole)


def test_any_byte_but_zero_means_that_a_finger_is_present():
    stream, (readings, present, times) = made(1)
    other = (present.astype(np.uint8) * 200).view(np.bool_)
    whole = advanced(stream.start(), stream, (readings, present, times))
    assert_same(advanced(stream.start(), stream, (readings, other, times)), whole)


def test_a_stream_that_another_thread_uses_raises_and_is_not_harmed():
    stream, samples = made(2)
    steps = np.arange(30) * (samples[2][-1] - samples[2][0] + 1.0)
    samples = [
        np.concatenate([samples[0]] * 30),
        np.concatenate([samples[1]] * 30),
        np.concatenate([samples[2] + step for step in steps]),
    ]
    expected = advanced(stream.start(), stream, samples)
    nothing, refused = [values[:0] for values in samples], []
    for _ in range(50):  # until a call was made while the thread was inside one
        c, found = stream.start(), []
        thread = threading.Thread(
            target=lambda c=c, found=found: found.extend(advanced(c, stream, samples))
        )
        thread.start()
        while thread.is_alive():
            try:
                advanced(c, stream, nothing)
            except RuntimeError as error:
                refused.append(str(error))
        thread.join()
        assert_same(found, expected)
        if refused:
            break
    assert set(refused) == {"another thread is using this stream"}


@pytest.mark.parametrize("call", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_stream_cannot_be_copied(call):
    with pytest.raises(TypeError, match=r"cannot pickle .*Stream. object"):
        call(made()[0].start())


def refused(change, error):
    """Return the message of a call with one argument changed."""
    stream, samples = made()
    n, n_fingers, n_features = (*samples[1].shape, stream.plan.width)
    arguments = dict(zip(("readings", "present", "times"), samples, strict=True))
    arguments["features"] = np.zeros((n, n_fingers, n_features))
    arguments["amplitude"] = np.zeros((n, n_fingers))
    arguments |= change(arguments)
    with pytest.raises(error) as raised:
        stream.start().advance(*arguments.values())
    return str(raised.value)


@pytest.mark.parametrize("name", ["readings", "present", "times", "features", "amplitude"])
def test_arrays_that_do_not_fit_are_refused(name):
    kind = "bool" if name == "present" else "float64"
    wrong = refused(lambda a: {name: np.zeros(a[name].shape, np.float32)}, TypeError)
    assert wrong == f"{name}: {kind} expected, the format f given"
    wrong = refused(lambda a: {name: a[name][None]}, ValueError)
    assert f"axes expected, {1 + {'readings': 3, 'times': 1, 'features': 3}.get(name, 2)}" in wrong
    assert "axis 0 has the length" in refused(lambda a: {name: a[name][:-1]}, ValueError)
    if name != "times":
        wrong = refused(lambda a: {name: np.repeat(a[name], 2, axis=-1)}, ValueError)
        assert wrong.startswith(f"{name}: axis ")
    assert "C-contiguous" in refused(lambda a: {name: a[name][::-1]}, ValueError)
    assert "bytes-like" in refused(lambda a: {name: a[name].tolist()}, TypeError)


def test_results_that_are_read_only_or_share_memory_are_refused():
    def read_only(arguments):
        arguments["features"].flags.writeable = False
        return {}

    assert "read-only" in refused(read_only, ValueError)
    wrong = refused(
        lambda a: {"amplitude": a["features"].ravel()[: a["amplitude"].size].reshape(
            a["amplitude"].shape
        )},
        ValueError,
    )  # fmt: skip
    assert wrong == "features and amplitude share memory"
    wrong = refused(lambda a: {"times": a["amplitude"].ravel()[: len(a["times"])]}, ValueError)
    assert wrong == "times and amplitude share memory"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, -1e308, "as before"])
def test_times_that_do_not_increase_are_refused(bad):
    def change(arguments):
        times = arguments["times"].copy()
        times[5] = times[4] if bad == "as before" else bad
        return {"times": times}

    expected = "times: number 5 is not finite, or not later than the one before"
    assert refused(change, ValueError) == expected


def test_times_increase_from_call_to_call():
    stream, samples = made()
    c = stream.start()
    advanced(c, stream, samples)
    with pytest.raises(ValueError, match="times"):
        advanced(c, stream, samples)


def tables_of(stream):
    """Return the arguments with which the stream is made."""
    return copy.deepcopy(list(stream.tables()))


CHANGES = {
    "no hand": (lambda t: t.__setitem__(0, None), "must be dict"),
    "a tuple of fingers": (lambda t: t.__setitem__(1, tuple(t[1])), "must be list"),
    "a finger less": (lambda t: t[1].pop(), "dictionaries with the field first_taxel expected"),
    "a feature less": (lambda t: t[2].pop(), "dictionaries with the field kind expected"),
    "a lag more": (lambda t: t[3].append({}), "dictionaries with the field samples expected"),
    "no dictionary": (lambda t: t[1].__setitem__(0, [1]), "a dictionary expected, [1] given"),
    "a field less": (lambda t: t[0].pop("period"), "period"),
    "a field more": (lambda t: t[0].update(other=1), "16 fields expected, 17 given"),
    "a text": (lambda t: t[0].update(period="1"), "must be real number, not str"),
    "a fraction": (lambda t: t[0].update(n_lanes=1.5), "an integer is required"),
    "less than nothing": (lambda t: t[0].update(n_lanes=-1), "can't convert negative"),
    "64 bits": (lambda t: t[0].update(tare_kind=2**40), "has more than 32 bits"),
    "no period": (lambda t: t[0].update(period=0.0), "tables that do not fit: period"),
    "a normal of two axes": (lambda t: t[1][0].pop("normal[2]"), "normal[2]"),
    "too many lanes": (lambda t: t[0].update(n_lanes=2**50), "n_lanes, n_features or n_lags"),
    "too many fingers": (lambda t: t[0].update(n_fingers=2**62), "n_lanes, n_features or n_lags"),
    "another history": (lambda t: t[0].update(n_history=2**40), "do not fit: n_history"),
    "more lanes": (lambda t: t[0].update(n_lanes=t[0]["n_lanes"] + 1), "used: axis 0"),
    "an array less": (lambda t: t.pop(), "takes exactly 8 arguments (7 given)"),
    "other numbers": (lambda t: t.__setitem__(5, t[5].astype("f4")), TEXT_OF_AN_ARRAY),
    "a longer baseline": (lambda t: t.__setitem__(7, np.vstack([t[7]] * 2)), "baseline: axis 0"),
    "no baseline": (lambda t: t.__setitem__(7, None), "a bytes-like object is required"),
    "a taxel of the next finger": (
        lambda t: t[1][0].update(n_taxels=t[1][0]["n_taxels"] + 1000),
        "tables that do not fit: ",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_tables_that_do_not_fit_are_refused(name):
    change, message = CHANGES[name]
    arguments = tables_of(made()[0])
    _extension.Stream(*arguments)
    change(arguments)
    with pytest.raises(
        (TypeError, ValueError, KeyError, OverflowError, IndexError), match=re.escape(message)
    ):
        _extension.Stream(*arguments)


@pytest.mark.parametrize("which", [1, 2])
def test_a_number_that_cuts_the_list_it_is_in_is_refused(which):
    arguments = tables_of(made()[0])
    field = {1: "low", 2: "floor"}[which]

    class Cutting:
        def __float__(self):
            arguments[which].clear()
            return 1.0

    arguments[which][0][field] = Cutting()
    with pytest.raises(IndexError):
        _extension.Stream(*arguments)


def test_a_stream_takes_no_names():
    with pytest.raises(TypeError, match="Stream"):
        _extension.Stream(hand={})
