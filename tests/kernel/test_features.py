from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holdfast
from exporters.c_detector import random_samples
from exporters.models import MODELS, made
from holdfast.detector import Detector
from holdfast.features import Tare
from holdfast.features.stream import FeatureStream
from holdfast.io import import_recordings, load_recording
from holdfast.model import Model
from kernel import random_streams
from kernel.c_kernel import compiled, difference
from kernel.random_streams import random_plan

N_SAMPLES = 6000


@pytest.fixture(scope="module", params=[1, 4], ids=["in-order", "in-lanes"])
def library(request, tmp_path_factory):
    """The kernel with the sums of Python's, whose bits it has; and as it is used."""
    return compiled(tmp_path_factory.mktemp("kernel"), lanes=request.param)


def assert_equal(library, stream, rows, ill_conditioned=False):
    """Hold the kernels equal: to the last bit, or but for the rounding of sums over taxels."""
    of_lanes = np.inf if ill_conditioned else 1e-9
    found, n = difference(library, stream, rows, 0.0 if library.lanes == 1 else of_lanes)
    assert found is None, stream.plan
    return n


def stream_of(name, tare=None, ignore=None, **options):
    """Return the feature stream of a model of `exporters.models`."""
    model, sensors, rate = made(name)
    plan = Detector(model, sensors, rate, ignore=ignore, **options)._stream.plan
    return FeatureStream(replace(plan, tare=Tare.parse(tare)) if tare is not None else plan)


def random_rows(stream, seed, n=N_SAMPLES):
    """Yield random samples of a stream as arrays; times increase, as a detector requires."""
    sensors, last = stream.plan.sensors, -np.inf
    counts = all(sensor.unit == "count" for sensor in sensors.values())
    rng = np.random.default_rng(seed)
    for samples, time in random_samples(rng, sensors, stream.plan.rate, n, counts):
        if not last < time < np.inf:
            continue
        last = time
        readings = np.full((len(stream.layout.rotations), 3), np.nan)
        for finger, sample in samples.items():
            readings[stream.slices[finger]] = sample
        present = np.array([finger in samples for finger in sensors])
        yield readings, present, time


def recorded_rows(stream, recording, rng):
    """Yield the samples of a recording, some of which have a reading that is not valid."""
    for chunk in stream.samples_of(recording):
        for time, present, readings in zip(*chunk, strict=True):
            if rng.random() < 0.01:
                bad = rng.choice([np.nan, np.inf, -1e9, 65535.0])
                readings[rng.integers(len(readings)), rng.integers(3)] = bad
            if rng.random() > 0.002:  # some are lost
                yield readings, present, time


def assert_equal_on(library, name, recording):
    """Hold the kernels equal on a recording that some samples and readings are lost of."""
    stream = Detector.for_recording(Model.load(name), recording)._stream
    rows = recorded_rows(stream, recording, np.random.default_rng(9))
    assert_equal(library, FeatureStream(stream.plan), rows)


class TestEqualsThePythonKernel:
    @pytest.mark.parametrize("in_contact", [False, True])
    @pytest.mark.parametrize("name", MODELS)
    def test_random_samples(self, library, name, in_contact):
        stream = stream_of(name, in_contact=in_contact)
        assert assert_equal(library, stream, random_rows(stream, 5)) > 0.9 * N_SAMPLES

    @pytest.mark.parametrize("tare", ["first", "none", 0.1, 5.0])
    @pytest.mark.parametrize("name", ["rich", "any"])
    def test_other_tares(self, library, name, tare):
        stream = stream_of(name, tare=tare)
        assert_equal(library, stream, random_rows(stream, 6, 3000))

    @pytest.mark.parametrize("n_ignored", [1, 20, 30])
    def test_ignored_taxels(self, library, n_ignored):
        ignore = {"index": range(n_ignored), "thumb": [7]}
        stream = stream_of("twin", ignore=ignore)
        assert_equal(library, stream, random_rows(stream, 7, 3000))

    def test_baselines_of_a_loaded_start(self, library):
        baselines = {name: np.full((30, 3), 29990.0) for name in ("thumb", "index", "middle")}
        stream = stream_of("any", in_contact=True, baselines=baselines)
        assert_equal(library, stream, random_rows(stream, 8, 3000))

    @pytest.mark.parametrize("name", ["builtin:noise-floor", "builtin:any"])
    def test_the_recording_of_the_package(self, library, name):
        recording = load_recording(Path(holdfast.__file__).parent / "recorded/box-slips.mcap")
        assert_equal_on(library, name, recording)

    @pytest.mark.parametrize("dataset", ["uskin_pick_move", "gtac"])
    def test_recordings_of_real_sensors(self, library, dataset, data_folder):
        for recording in list(import_recordings(data_folder / dataset))[:2]:
            assert_equal_on(library, "builtin:any", recording)

    @pytest.mark.parametrize("seed", range(20))
    def test_random_hands(self, library, seed):
        rng = np.random.default_rng(seed)
        for _ in range(5):
            plan = random_plan(rng)
            rows = random_streams.random_rows(rng, plan, 600)
            # In lanes only faults are equal: what is added up may be far larger than what changes.
            assert_equal(library, FeatureStream(plan), rows, ill_conditioned=True)
