from dataclasses import replace

import pytest

from holdfast.errors import TrainingError
from holdfast.recordings import Recording
from holdfast.training.dataset_scan import scan_dataset

from .build import TINY, tiny_module, tiny_recording

WIDE = replace(TINY, name="wide", positions=TINY.positions.repeat(2, 0),
               rotations=TINY.rotations.repeat(2, 0))  # fmt: skip


def test_names_sensors_and_counts(grasps):
    found = scan_dataset(iter(grasps))
    assert [entry.name for entry in found.recordings] == [each.name for each in grasps]
    assert [entry.digest for entry in found.recordings] == [each.digest for each in grasps]
    assert found.recordings[4].object == "object 1"
    assert found.recordings[0].n_labelled == {"thumb": 400, "index": 400}
    assert found.sensors == {"thumb": TINY, "index": TINY}
    assert found.rate == pytest.approx(100.0)
    assert found.n_labelled == 2400


def test_fingers_without_labels_do_not_count(grasps):
    bare = grasps[0].with_labels({"thumb": grasps[0].modules["thumb"].labels})
    assert set(scan_dataset([bare]).sensors) == {"thumb"}


def test_the_rate_is_the_median():
    given = [tiny_recording(seed, rate=rate) for seed, rate in enumerate([100.0, 50.0, 105.0])]
    assert scan_dataset(given).rate == pytest.approx(100.0)
    assert scan_dataset(given, 80.0).rate == 80.0


def same_samples():
    one = tiny_recording(0)
    return [one, tiny_recording(1), replace(one, name="copy", metadata={"object": "another"})]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([], "no recordings"),
        ([tiny_recording(seed, states=[None] * 4) for seed in range(2)], "labels"),
        (same_samples(), "'grasp-0' and 'copy'"),
        ([tiny_recording(0), replace(tiny_recording(1), name="grasp-0")], "'grasp-0'"),
        ([tiny_recording(0), tiny_recording(1, sensor=WIDE)], "thumb of 'grasp-1'.* wide"),
        ([tiny_recording(0), tiny_recording(1, unit="N")], "thumb of 'grasp-1'.* N"),
        ([tiny_recording(0), tiny_recording(1, sensor=replace(TINY, rate=99.0))], "rate"),
    ],
)
def test_refusals(given, message):
    with pytest.raises(TrainingError, match=message):
        scan_dataset(given)


def test_another_sensor_without_labels_is_ignored():
    other = Recording("other", {"thumb": tiny_module(9, sensor=WIDE, states=[None] * 4)})
    assert scan_dataset([tiny_recording(0), other]).sensors["thumb"] == TINY
