"""Handling of a live source: what is recorded of it, and its start."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.errors import SourceError
from holdfast.live.handling import record_handling
from holdfast.live.stream_detector import StreamDetector
from holdfast.training import calibrate
from live import build
from training.build import handling_recording, normalised_model

pytestmark = pytest.mark.slow


def handled(seed=1, held=20.0, **options):
    return handling_recording(seed, held=held, open_for=2.0, **options)


def part_of(recording, start, stop):
    modules = {
        name: module.slice(*np.searchsorted(module.times, (start, stop)))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def recorded(recording, seconds=60.0, is_over=lambda: False, **options):
    """Return what is recorded of a source that sends a recording, and the lines about it."""
    stream = StreamDetector(normalised_model(), build.Script.of(recording), **options)
    lines = []
    return record_handling(stream, seconds, 0.0, is_over, lines.append), lines


def test_the_samples_are_those_of_the_source_and_the_held_time_is_reported():
    recording = handled()
    found, lines = recorded(recording)
    for name, module in recording.modules.items():
        np.testing.assert_array_equal(found.modules[name].times, module.times)
        np.testing.assert_array_equal(found.modules[name].readings, module.readings)
    assert found.metadata == {}
    assert [line.split(",")[0] for line in lines] == ["10 of 60 s", "20 of 60 s"]
    expected = calibrate(normalised_model(), [replace(recording, name=found.name)])
    assert calibrate(normalised_model(), [found]) == expected


def test_it_ends_after_its_seconds_or_early():
    recording = handled()
    found, _ = recorded(recording, seconds=12.0)
    assert found.duration == pytest.approx(12.0, abs=0.6)
    left = iter(range(400))
    found, _ = recorded(recording, is_over=lambda: next(left, None) is None)
    assert found.modules["thumb"].n_samples == 400


def test_a_stream_that_begins_in_contact_is_recorded_as_one():
    begun = part_of(handled(), 4.0, 20.0)
    assert recorded(begun)[0].metadata == {}
    assert recorded(begun, in_contact=True)[0].metadata == {"starts_loaded": True}
    modules = begun.modules.items()
    rest = {name: np.zeros((x.sensor.n_taxels, 3)).tolist() for name, x in modules}
    declared = {"starts_loaded": True, "baselines": rest}
    source = build.Script.of(begun)
    source.metadata |= declared
    stream = StreamDetector(normalised_model(), source)
    found = record_handling(stream, 60.0, 0.0, lambda: False, lambda _: None)
    assert found.metadata == declared


def test_a_source_without_samples_is_an_error():
    with pytest.raises(SourceError, match="script sent no samples: nothing was recorded"):
        recorded(handled(), is_over=lambda: True)
