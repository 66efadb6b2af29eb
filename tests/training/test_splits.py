import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.errors import TrainingError
from holdfast.training.classifiers import Samples
from holdfast.training.dataset_scan import ScannedRecording
from holdfast.training.splits import (
    RANDOM_FOLDS,
    TIME_FOLDS,
    TIME_GAP,
    inner_folds,
    split_data,
)


def entries(*objects, blocks=()):
    blocks = np.array([*blocks, *range(len(blocks), len(objects))], np.uint64)
    return [
        ScannedRecording(f"grasp-{k}", str(k), str(k), thing, 100.0, {}, blocks[k : k + 1])
        for k, thing in enumerate(objects)
    ]


def test_a_unit_of_the_split_by_recording_is_a_recording():
    data_split = split_data(entries("can", "can", None), "recording", 0)
    assert data_split.units == ("grasp-0", "grasp-1", "grasp-2")
    assert data_split.units_of(2, 4).tolist() == [2] * 4
    assert data_split.recordings_without({1}) == [0, 2]


def test_a_unit_of_the_split_by_object_is_all_its_recordings():
    data_split = split_data(entries("can", "egg", "can"), "object", 0)
    assert data_split.units == ("can", "egg")
    assert [data_split.units_of(index, 1)[0] for index in range(3)] == [0, 1, 0]
    assert data_split.recordings_without({0}) == [1]


def test_recordings_that_share_readings_are_held_out_together():
    shared = entries("can", "egg", "can", blocks=(7, 8, 7))
    assert split_data(shared, "object", 0).units == ("can", "egg")
    with pytest.raises(TrainingError, match=r"'grasp-0' and 'grasp-2' .* --split object"):
        split_data(shared, "recording", 0)
    with pytest.raises(TrainingError, match="'grasp-0' and 'grasp-1' "):
        split_data(entries("can", "egg", "can", blocks=(7, 7, 7)), "object", 0)
    for split in ("time", "random"):  # they part each recording on purpose
        assert len(split_data(shared, split, 0).units) == 5


@given(seed=st.integers(0, 2**32 - 1), index=st.integers(0, 50))
def test_random_fifths(seed, index):
    data_split = split_data(entries("can"), "random", seed)
    units = data_split.units_of(index, 2000)
    assert (units == data_split.units_of(index, 2000)).all()
    shares = np.bincount(units, minlength=RANDOM_FOLDS) / 2000
    assert shares == pytest.approx(0.2, abs=0.06)
    assert data_split.recordings_without({0}) == [0]


def test_random_fifths_differ_by_recording_and_seed():
    data_split = split_data(entries("can", "can"), "random", 0)
    other = split_data(entries("can", "can"), "random", 1)
    assert (data_split.units_of(0, 100) != data_split.units_of(1, 100)).any()
    assert (data_split.units_of(0, 100) != other.units_of(0, 100)).any()
    assert data_split.group_of.tolist() == [0, 1]  # a search never parts a recording


@pytest.mark.parametrize(
    ("objects", "split", "message"),
    [
        (["can", None], "object", "'grasp-1'"),
        (["can", "can"], "object", "split by object"),
        (["can"], "recording", "split by time"),
    ],
)
def test_refusals(objects, split, message):
    with pytest.raises(TrainingError, match=message):
        split_data(entries(*objects), split, 0)


def test_a_unit_of_the_split_by_time_is_a_block_of_every_recording():
    data_split = split_data(entries("can", "egg"), "time", 0)
    units = data_split.units_of(1, 1000)
    assert len(data_split.units) == TIME_FOLDS
    inside = np.flatnonzero(units >= 0)
    assert (units[inside] == inside // 200).all()
    assert data_split.recordings_without({0}) == [0, 1]


def test_between_two_blocks_of_time_there_is_a_gap():
    units = split_data(entries("can"), "time", 0).units_of(0, 1000)
    gap = round(100 * TIME_GAP)
    for start in range(200, 1000, 200):
        assert (units[start - gap : start + gap] == -1).all()
        assert units[start - gap - 1] == start // 200 - 1
        assert units[start + gap] == start // 200
    short = split_data(entries("can"), "time", 0).units_of(0, 100)
    assert np.bincount(short[short >= 0]).tolist() == [15, 10, 10, 10, 15]


def samples(stable, groups):
    return Samples(np.zeros((len(stable), 1)), np.array(stable, bool), np.array(groups))


@given(n_groups=st.integers(2, 12), n_folds=st.integers(2, 6), seed=st.integers(0, 99))
def test_inner_folds_hold_out_every_sample_once_and_whole_groups(n_groups, n_folds, seed):
    groups = np.repeat(np.arange(n_groups), 4)
    masks = inner_folds(samples([0, 1] * (2 * n_groups), groups), n_folds, seed)
    assert len(masks) == min(n_groups, n_folds)
    assert (np.sum(masks, axis=0) == 1).all()
    for mask in masks:
        assert not set(groups[mask]) & set(groups[~mask])


def test_inner_folds_leave_out_those_without_both_classes():
    given_samples = samples([0, 0, 0, 1, 0, 1], [0, 0, 1, 1, 2, 2])
    held = [set(given_samples.groups[mask]) for mask in inner_folds(given_samples, 3, 0)]
    assert sorted(held, key=str) == [{1}, {2}]


def test_inner_folds_leave_out_those_that_leave_one_class():
    # Without group 1 nothing stable is left; without group 0 both classes are.
    masks = inner_folds(samples([0, 0, 0, 1], [0, 0, 1, 1]), 5, 0)
    assert masks == []


def test_inner_folds_without_samples():
    assert inner_folds(samples([], []), 5, 0) == []
