"""The stream of the extension: chunks, threads, and arguments that do not fit."""

import copy
import pickle
import threading

import numpy as np
import pytest

from holdfast.detection.kernel_config import packed, stream_config
from kernel.extension import extension
from kernel.random_streams import random_plan, random_rows

N = 400


def made(seed=0, n=N):
    """A plan, and samples of it as the arrays that `advance` takes."""
    rng = np.random.default_rng(seed)
    plan = random_plan(rng)
    readings, present, times = map(np.array, zip(*random_rows(rng, plan, n), strict=True))
    return plan, [np.ascontiguousarray(readings), present, times]


def config_of(plan):
    """The bytes of which a stream of the extension is made."""
    return [*packed(stream_config(plan)), plan.baseline.tobytes()]


def started(plan):
    return extension.Stream(*config_of(plan))


def advanced(c, plan, samples):
    n, n_fingers, n_features = (*samples[1].shape, plan.width)
    out = [np.full((n, n_fingers, n_features), 7.0), np.full((n, n_fingers), 7.0)]
    c.advance(*samples, *out)
    return out


def assert_same(found, expected):
    for a, b in zip(found, expected, strict=True):
        assert np.array_equal(a, b, equal_nan=True)


def test_any_chunking_gives_the_same_bits():
    plan, samples = made(3)
    whole, c, parts = advanced(started(plan), plan, samples), started(plan), []
    for start, stop in ((0, 0), (0, 1), (1, 150), (150, 150), (150, N)):
        parts.append(advanced(c, plan, [values[start:stop] for values in samples]))
    assert_same([np.concatenate(part) for part in zip(*parts, strict=True)], whole)


def test_any_byte_but_zero_means_that_a_finger_is_present():
    plan, (readings, present, times) = made(1)
    other = (present.astype(np.uint8) * 200).view(np.bool_)
    whole = advanced(started(plan), plan, (readings, present, times))
    assert_same(advanced(started(plan), plan, (readings, other, times)), whole)


def test_a_stream_that_another_thread_uses_raises_and_is_not_harmed():
    plan, samples = made(2)
    steps = np.arange(30) * (samples[2][-1] - samples[2][0] + 1.0)
    samples = [
        np.concatenate([samples[0]] * 30),
        np.concatenate([samples[1]] * 30),
        np.concatenate([samples[2] + step for step in steps]),
    ]
    expected = advanced(started(plan), plan, samples)
    nothing, refused = [values[:0] for values in samples], []
    for _ in range(50):  # until a call was made while the thread was inside one
        c, found = started(plan), []
        thread = threading.Thread(
            target=lambda c=c, found=found: found.extend(advanced(c, plan, samples))
        )
        thread.start()
        while thread.is_alive():
            try:
                advanced(c, plan, nothing)
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
        call(started(made()[0]))


def refused(change, error):
    """Return the message of a call with one argument changed."""
    plan, samples = made()
    n, n_fingers, n_features = (*samples[1].shape, plan.width)
    arguments = dict(zip(("readings", "present", "times"), samples, strict=True))
    arguments["features"] = np.zeros((n, n_fingers, n_features))
    arguments["amplitude"] = np.zeros((n, n_fingers))
    arguments |= change(arguments)
    with pytest.raises(error) as raised:
        started(plan).advance(*arguments.values())
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
    plan, samples = made()
    c = started(plan)
    advanced(c, plan, samples)
    with pytest.raises(ValueError, match="times"):
        advanced(c, plan, samples)


CHANGES = {
    "no bytes": (0, lambda _: None, "hand: bytes expected, None given"),
    "an array": (4, lambda _: np.zeros(4), "used: bytes expected"),
    "a byte less": (1, lambda data: data[:-1], "fingers: "),
    "a feature more": (2, lambda data: data + bytes(56), "features: "),
    "a lag more": (3, lambda data: data + bytes(32), "lags: "),
    "another baseline": (7, lambda data: 2 * data, "baseline: "),
}


@pytest.mark.parametrize("name", CHANGES)
def test_constants_of_another_size_are_refused(name):
    index, change, message = CHANGES[name]
    config = config_of(made()[0])
    config[index] = change(config[index])
    with pytest.raises((TypeError, ValueError), match=f"^{message}"):
        extension.Stream(*config)


@pytest.mark.parametrize("field", ["n_fingers", "n_lanes", "n_features", "n_lags"])
@pytest.mark.parametrize("size", [2**50, 2**62])
def test_sizes_whose_product_would_overflow_are_refused(field, size):
    plan = made()[0]
    config = stream_config(plan)
    config.hand[field] = size
    with pytest.raises(ValueError, match="n_fingers, n_lanes, n_features or n_lags is too large"):
        extension.Stream(*packed(config), plan.baseline.tobytes())


def test_a_stream_takes_eight_arguments_without_names():
    config = config_of(made()[0])
    with pytest.raises(TypeError, match="8 arguments expected, 7 given"):
        extension.Stream(*config[:-1])
    with pytest.raises(TypeError, match="no arguments by name expected"):
        extension.Stream(hand=config[0])
