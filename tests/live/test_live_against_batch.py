"""Where live estimates equal those of a recording, and that the documents say where not."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from holdfast.detection import Detector, Model, detect
from holdfast.live.stream_detector import StreamDetector
from holdfast.recordings import Recording

from . import build

pytestmark = pytest.mark.slow

MODELS = ("builtin:any", "builtin:twin", "builtin:noise-floor")


def live(model, recording):
    """All estimates of a stream of the samples, by finger."""
    source = build.Script.of(recording)
    stream = StreamDetector(model, source)
    found = [one for arrival in source for one in stream.update(arrival).estimates]
    return {name: [one.estimate.fingers[name] for one in found] for name in recording.modules}


def batch(model, recording, bounds):
    """All estimates of a recording that comes in parts, by finger."""
    detector = Detector.for_recording(model, recording)
    parts = [
        {name: module.slice(a, b) for name, module in recording.modules.items()}
        for a, b in pairwise(bounds)
    ]
    traces = [detector.run(Recording("part", modules)).fingers for modules in parts]
    return {
        name: [one for fingers in traces for one in fingers[name].estimates()]
        for name in recording.modules
    }


@pytest.mark.parametrize("name", MODELS)
def test_the_same_bits_at_a_constant_rate_in_any_chunks(name):
    model, recording = Model.load(name), build.grasp()
    n = len(next(iter(recording.modules.values())).times)
    cuts = np.random.default_rng(2).choice(np.arange(1, n), size=6, replace=False)
    mine = live(model, recording)
    parts = batch(model, recording, [0, *sorted(cuts.tolist()), n])
    whole = detect(model, recording).fingers
    for finger, estimates in mine.items():
        texts = list(map(repr, estimates))
        assert texts == list(map(repr, parts[finger]))
        assert texts == list(map(repr, whole[finger].estimates()))


def both_of(name, times_of):
    """Live and offline estimates of a finger, of a grasp whose samples come at other times."""
    model, recording = Model.load(name), build.grasp()
    modules = {}
    for finger, module in recording.modules.items():
        times, kept = times_of(module.times)
        modules[finger] = replace(
            module, times=times[kept], readings=module.readings[kept], labels=()
        )
    changed = Recording("changed", modules)
    return live(model, changed)["index"], detect(model, changed).fingers["index"].estimates()


def slower(times):
    """The rate falls to half in the middle."""
    middle = times[len(times) // 2]
    return np.where(times < middle, times, 2 * times - middle), slice(None)


def bursts(times):
    """From 1 s on, samples come in bursts of five at twice the rate."""
    index = np.where(times < times[0] + 1.0, 0, np.arange(len(times)) % 5)
    return times - 0.5 * (times[1] - times[0]) * index, slice(None)


def dropped(times):
    """One of ten samples is missing, of all fingers alike."""
    return times, np.random.default_rng(4).random(len(times)) >= 0.1


@pytest.mark.parametrize(("times_of", "most"), [(slower, 1e-3), (bursts, 0.1), (dropped, 1e-3)])
def test_windows_in_seconds_give_the_same_at_other_times(times_of, most):
    mine, other = (
        np.array([one.stable_probability for one in estimates])
        for estimates in both_of("builtin:any", times_of)
    )
    np.testing.assert_array_equal(np.isnan(mine), np.isnan(other))
    assert np.nanmax(np.abs(mine - other)) <= most
