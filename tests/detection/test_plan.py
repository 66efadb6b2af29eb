import numpy as np
import pytest

from detection.detector.build import RATE, broken, recording, sensor, tactile
from holdfast.detection import Tare, fingertip_force, haar_features, parse_features
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan


def plan_of(tare="first", window=6, fingers=("thumb",)):
    features = dict.fromkeys(fingers, parse_features("sigma", window))
    return StreamPlan(dict.fromkeys(fingers, sensor()), features, window, Tare.parse(tare), RATE)


class TestExtract:
    @pytest.mark.parametrize("tare", [0.2, "first", "none", (0.3, 0.6)])
    @pytest.mark.parametrize("window", [2, 6, 14, 40])
    def test_equals_the_batch_functions(self, tare, window):
        which, module = sensor(5), tactile(300, which=sensor(5))
        features = parse_features("F_a,F_x,F_y,F_z,m,sigma", window)
        plan = StreamPlan({"thumb": which}, {"thumb": features}, window, Tare.parse(tare), RATE)
        force = fingertip_force(module.readings, which, tare, module.times)
        expected = haar_features(force, window)
        found = extract(plan, recording(thumb=module))["thumb"]
        assert np.array_equal(found.features, expected, equal_nan=True)
        assert np.allclose(found.amplitude, np.linalg.norm(force, axis=1), equal_nan=True)

    def test_a_stretch_starts_again_after_a_gap(self):
        which, module = sensor(), broken(tactile())
        features = parse_features("sigma", 6)
        plan = StreamPlan({"thumb": which}, {"thumb": features}, 6, Tare.parse("first"), RATE)
        found = extract(plan, recording(thumb=module))["thumb"].features
        batch = haar_features(fingertip_force(module.readings, which, "first"), 6)[:, 5:]
        both = np.isfinite(found)
        assert np.array_equal(found[both], batch[both])
        assert np.isnan(found[70:75]).all()
        assert np.isfinite(found[75])


class TestStreamPlan:
    def test_samples_share_an_instant_and_come_in_chunks(self, monkeypatch):
        monkeypatch.setattr("holdfast.detection.plan.CHUNK_SAMPLES", 7)
        made = recording(thumb=tactile(20, 1), index=tactile(20, 2, times=np.arange(5, 25) / RATE))
        plan = plan_of(fingers=("index", "thumb", "middle"))
        chunks = list(plan.samples_of(made))
        assert [len(chunk.times) for chunk in chunks] == [7, 7, 7, 4]
        times, present, readings = map(np.concatenate, zip(*chunks, strict=True))
        assert np.array_equal(times, np.arange(25) / RATE)
        assert present.sum(axis=0).tolist() == [20, 20, 0]
        for place, name in enumerate(("index", "thumb")):
            rows = readings[present[:, place], plan.slices[name]]
            assert np.array_equal(rows, made.modules[name].readings)

    def test_the_tare_of_an_interval(self):
        made = recording(thumb=tactile(seed=3))
        plan = plan_of("0.5:0.9").for_recording(made)
        expected = made.modules["thumb"].readings[50:90].mean(axis=0)
        assert np.allclose(plan.baseline, expected)

    def test_no_baseline_before_the_first_sample(self):
        assert not plan_of().baseline.any()
