import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.recordings import (
    Label,
    Recording,
    Tactile,
    Truth,
    label_states,
    labels_from_samples,
)
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

SENSOR = sensor("anyskin")
STATES = (ContactState.STABLE, ContactState.UNSTABLE, ContactState.NO_CONTACT)


def tactile(n=10, **fields):
    """Ten samples at 100 Hz that count upwards."""
    readings = np.arange(n * 15, dtype=np.float32).reshape(n, 5, 3)
    return Tactile(
        **({"sensor": SENSOR, "times": np.arange(n) / 100, "readings": readings} | fields)
    )


def recording(**fields):
    return Recording(**({"name": "one", "modules": {"finger1": tactile()}} | fields))


class TestLabel:
    @pytest.mark.parametrize("span", [(1, 1), (2, 1), (0, float("nan")), (0, float("inf"))])
    def test_ends_after_its_start(self, span):
        with pytest.raises(ValueError, match="ends after its start"):
            Label(*span, ContactState.STABLE)

    @pytest.mark.parametrize("state", [ContactState.UNKNOWN, "UNKNOWN"])
    def test_unknown_is_no_label(self, state):
        with pytest.raises(ValueError, match="UNKNOWN"):
            Label(0, 1, state)

    def test_refuses_unknown_states_and_causes(self):
        with pytest.raises(ValueError, match="'wobbly'"):
            Label(0, 1, "wobbly")
        with pytest.raises(ValueError, match="'wind'"):
            Label(0, 1, ContactState.UNSTABLE, "wind")

    @pytest.mark.parametrize("confidence", [-0.1, 1.1, float("nan")])
    def test_confidence(self, confidence):
        with pytest.raises(ValueError, match="confidence"):
            Label(0, 1, ContactState.STABLE, confidence=confidence)


class TestTactile:
    @pytest.mark.parametrize(
        ("fields", "message"),
        [
            ({"times": np.zeros((10, 1))}, "times of shape"),
            ({"readings": np.zeros((10, 15))}, "anyskin"),
            ({"readings": np.zeros((10, 5, 2))}, "anyskin"),
            ({"readings": np.zeros((10, 4, 3))}, "4 taxels"),
            ({"readings": np.zeros((9, 5, 3))}, "9 samples"),
            ({"readings": np.zeros((10, 5, 3), bool)}, "bool"),
            ({"readings": np.zeros((10, 5, 3), complex)}, "complex128"),
            ({"times": np.array([0, 1, 2, 3, np.nan, 5, 6, 7, 8, 9])}, "not finite"),
            ({"times": np.array([0, 1, 2, 3, 3, 5, 6, 7, 8, 9])}, "sample 4"),
            ({"times": 1.7e9 + np.array([0, 1, 2, 1.5, 4, 5, 6, 7, 8, 9])}, "sample 3"),
        ],
    )
    def test_refuses(self, fields, message):
        with pytest.raises(RecordingError, match=message):
            tactile(**fields)

    def test_labels_within_the_recording(self):
        with pytest.raises(RecordingError, match="outside"):
            tactile(labels=(Label(0, 1, ContactState.STABLE),))

    def test_labels_do_not_overlap(self):
        labels = (Label(0, 0.05, ContactState.STABLE), Label(0.04, 0.06, ContactState.UNSTABLE))
        with pytest.raises(RecordingError, match="overlap"):
            tactile(labels=labels)

    def test_labels_are_put_in_order(self):
        late, early = Label(0.05, 0.06, ContactState.STABLE), Label(0, 0.05, ContactState.UNSTABLE)
        assert tactile(labels=[late, early]).labels == (early, late)

    def test_arrays_are_read_only(self):
        given = tactile()
        with pytest.raises(ValueError, match="read-only"):
            given.times[0] = 1
        with pytest.raises(ValueError, match="read-only"):
            given.readings[0] = 1

    @pytest.mark.parametrize("dtype", [np.uint16, np.int32, np.float32, np.float64])
    def test_readings_keep_their_type(self, dtype):
        assert tactile(readings=np.ones((10, 5, 3), dtype)).readings.dtype == dtype

    def test_missing_values_are_allowed(self):
        assert np.isnan(tactile(readings=np.full((10, 5, 3), np.nan)).readings).all()

    def test_unit_is_that_of_the_sensor_unless_given(self):
        assert tactile().unit == "count"
        assert tactile(unit="N").unit == "N"

    def test_calibrated_readings_lose_what_is_known_of_raw_ones(self):
        raw = replace(sensor("uskin-4x4"), range=(0, 9), step=1.0, rests_at_zero=True)
        one = Tactile(raw, np.arange(2) / 100, np.zeros((2, 16, 3)), "N").sensor
        assert (one.range, one.step, one.rests_at_zero) == (None, None, False)

    def test_rate_gaps_and_repeats(self):
        times = np.array([0, 1, 2, 3, 7, 8, 9, 10, 11, 12]) / 100
        readings = np.repeat(np.arange(5.0), 2)[:, None, None] * np.ones((5, 3))
        given = tactile(times=times, readings=readings)
        assert given.rate == pytest.approx(100)
        assert given.n_gaps == 1  # four periods; three are none
        assert given.n_repeats == 5

    def test_no_samples(self):
        empty = tactile(n=0)
        assert (empty.n_samples, empty.n_gaps, empty.n_repeats) == (0, 0, 0)
        assert empty.label_states.shape == (0,)

    def test_label_states(self):
        labels = (
            Label(0.02, 0.04, ContactState.STABLE),
            Label(0.04, 0.05, ContactState.UNSTABLE, Cause.SLIP),
        )
        assert tactile(labels=labels).label_states.tolist() == [
            UNKNOWN, UNKNOWN, STABLE, STABLE, UNSTABLE, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN,
        ]  # fmt: skip

    def test_slice_cuts_the_labels(self):
        labels = (
            Label(0, 0.03, ContactState.STABLE),
            Label(0.03, 0.05, ContactState.UNSTABLE),
            Label(0.08, 0.1, ContactState.STABLE),
        )
        whole = tactile(labels=labels)
        part = whole.slice(2, 6)
        assert part.times.tolist() == whole.times[2:6].tolist()
        assert part.label_states.tolist() == whole.label_states[2:6].tolist()
        assert part.labels == (replace(labels[0], start=0.02), labels[1])

    @given(st.integers(0, 10), st.integers(0, 10), st.integers(0, 2**32 - 1))
    def test_any_slice_keeps_its_label_states(self, start, stop, seed):
        random = np.random.default_rng(seed)
        times = np.cumsum(random.uniform(0.001, 0.5, 10))
        states = [(STATES[k], None) for k in random.integers(0, 3, 10)]
        whole = tactile(times=times, labels=labels_from_samples(times, states, period=0.001))
        part = whole.slice(start, stop)
        assert part.label_states.tolist() == whole.label_states[start:stop].tolist()


class TestLabelsFromSamples:
    @given(st.data())
    def test_round_trip(self, data):
        n = data.draw(st.integers(0, 30))
        steps = data.draw(arrays.arrays(float, n, elements=st.floats(1e-3, 10)))
        times = 100 + np.cumsum(steps)
        pairs = st.none() | st.tuples(st.sampled_from(STATES), st.none() | st.sampled_from(Cause))
        states = data.draw(st.lists(pairs, min_size=n, max_size=n))
        labels = labels_from_samples(times, states, period=0.01, evidence="test", author="me")
        expected = [UNKNOWN if state is None else state[0].code for state in states]
        assert label_states(labels, times).tolist() == expected
        assert all((label.evidence, label.author) == ("test", "me") for label in labels)

    def test_equal_neighbours_are_one_label(self):
        stable, slip = (ContactState.STABLE, None), (ContactState.UNSTABLE, Cause.SLIP)
        labels = labels_from_samples(np.arange(5.0), [stable, stable, None, slip, slip], period=0.5)
        assert labels == (
            Label(0, 2, ContactState.STABLE),
            Label(3, 4.5, ContactState.UNSTABLE, Cause.SLIP),
        )


class TestRecording:
    @pytest.mark.parametrize("modules", [{}, {"finger1": tactile(n=0)}])
    def test_needs_a_sample(self, modules):
        with pytest.raises(RecordingError, match="'one' has no samples"):
            Recording("one", modules)

    def test_mappings_are_read_only(self):
        with pytest.raises(TypeError):
            recording().modules["finger1"] = tactile()
        with pytest.raises(TypeError):
            recording().metadata["object"] = "can"

    def test_with_labels_replaces_all(self):
        label = Label(0, 0.05, ContactState.STABLE)
        labelled = recording().with_labels({"finger1": [label]})
        assert labelled.modules["finger1"].labels == (label,)
        assert labelled.with_labels({}).modules["finger1"].labels == ()

    def test_digest_is_of_the_samples_only(self):
        one = recording()
        labelled = one.with_labels({"finger1": [Label(0, 0.05, ContactState.STABLE)]})
        assert labelled.digest == one.digest
        assert (
            recording(name="two", metadata={"object": "can"}, complete=False).digest == one.digest
        )

    @given(st.integers(0, 10 * 5 * 3 * 32 - 1))
    def test_digest_changes_with_one_bit(self, bit):
        readings = tactile().readings.copy()
        readings.view(np.uint8).reshape(-1)[bit // 8] ^= 1 << bit % 8
        changed = recording(modules={"finger1": tactile(readings=readings)})
        assert changed.digest != recording().digest

    def test_digest_depends_on_times_module_sensor_and_unit(self):
        others = [
            {"finger2": tactile()},
            {"finger1": tactile(times=1 + np.arange(10) / 100)},
            {"finger1": tactile(unit="N")},
            {"finger1": tactile(readings=tactile().readings.astype(np.float64))},
            {"finger1": tactile(sensor=replace(SENSOR, name="other"))},
        ]
        digests = {recording(modules=modules).digest for modules in others}
        assert len(digests | {recording().digest}) == 6

    @pytest.mark.parametrize("copied", [copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))])
    def test_can_be_sent_to_other_processes(self, copied):
        truth = Truth(
            np.arange(3.0), {"phase": np.ones(3)}, {"finger1": {"slip_speed": np.ones(3)}}
        )
        one = recording(truth=truth, markers=((0.5, "bump"),), metadata={"object": "can"})
        other = copied(one)
        assert other.digest == one.digest
        assert (other.metadata, other.markers) == (one.metadata, one.markers)
        assert other.truth.fingers["finger1"]["slip_speed"].tolist() == [1, 1, 1]
        assert not other.modules["finger1"].readings.flags.writeable


class TestTruth:
    @pytest.mark.parametrize(
        "fields", [{"hand": {"phase": np.ones(2)}}, {"fingers": {"thumb": {"phase": np.ones(2)}}}]
    )
    def test_as_many_rows_as_times(self, fields):
        with pytest.raises(RecordingError, match="'phase'"):
            Truth(np.arange(3.0), **fields)

    def test_a_slice_has_the_rows_of_its_samples(self):
        truth = Truth(
            np.arange(5.0),
            {"joints": np.arange(10.0).reshape(5, 2)},
            {"thumb": {"slip_speed": np.arange(5)}},
        )
        part = truth.slice(1, 3)
        assert part.times.tolist() == [1.0, 2.0]
        assert part.hand["joints"].tolist() == [[2.0, 3.0], [4.0, 5.0]]
        assert part.fingers["thumb"]["slip_speed"].tolist() == [1, 2]
        assert len(truth.slice(5, 5).times) == 0

    def test_arrays_are_read_only(self):
        truth = Truth(np.arange(3.0), {"joints": np.ones((3, 16))})
        with pytest.raises(ValueError, match="read-only"):
            truth.hand["joints"][0] = 0


def test_the_digest_of_readings_is_that_of_a_copy():
    whole = synthetic_recording("a", 0, ("thumb", "index"))
    thumb, index = whole.modules.values()
    copy_of = {
        "thumb": replace(thumb, times=thumb.times + 9, readings=thumb.readings * 1.0, labels=()),
        "other": replace(index, times=index.times + 9, labels=()),
    }
    renamed = Recording("b", copy_of)
    assert renamed.readings_digest == whole.readings_digest
    assert renamed.digest != whole.digest
    changed = np.array(thumb.readings)
    changed[-1, -1, -1] += 1
    other = replace(whole, modules={**whole.modules, "thumb": replace(thumb, readings=changed)})
    assert other.readings_digest != whole.readings_digest


def test_two_equal_modules():
    whole = synthetic_recording("a", 0, ("thumb", "index"))
    whole.check_modules_differ()
    thumb = whole.modules["thumb"]
    with pytest.raises(RecordingError, match="thumb and index"):
        replace(whole, modules=dict.fromkeys(("thumb", "index"), thumb)).check_modules_differ()
    still = replace(thumb, readings=np.zeros_like(thumb.readings))
    replace(whole, modules=dict.fromkeys(("thumb", "index"), still)).check_modules_differ()


@pytest.mark.parametrize(("loaded", "expected"), [(None, True), (False, False), (True, True)])
def test_a_start_is_declared_or_stays(loaded, expected):
    made = synthetic_recording("a", seed=0)
    recording = replace(made, metadata={"starts_loaded": True, "object": "can"})
    declared = recording.with_start(loaded=loaded)
    assert declared.starts_loaded is expected
    assert declared.metadata["object"] == "can"
    assert recording.starts_loaded  # the recording itself is unchanged


def test_a_start_is_an_open_hand_unless_the_metadata_are_true():
    made = synthetic_recording("a", seed=0)
    assert not made.starts_loaded
    assert not replace(made, metadata={"starts_loaded": "yes"}).starts_loaded
