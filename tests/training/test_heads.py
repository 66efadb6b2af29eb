"""Every way to change a model keeps what it does not change: all four heads; the fit of causes."""

import dataclasses

import numpy as np
import pytest
from msgspec.structs import replace
from sklearn.linear_model import LogisticRegression

from holdfast.contact import Cause, ContactState
from holdfast.detection import ANY_FINGER, Head, fingertip_force, haar_features, parse_features
from holdfast.recordings import Label
from holdfast.training import Setting, calibrate, train
from holdfast.training.head_fits import CAUSE_PENALTY, fit_causes
from holdfast.training.thresholds import tune

from .build import TINY, handling_recording, normalised_model, sliding_recording, tiny_recording

FEATURES = parse_features("F_a,F_x,F_y,F_z,m,sigma", 6)
NAMES = {"stable", "slip", "slip_speed", "cause", "slip_changes"}


def full_model():
    """`builtin:any` with a head of the speed, too."""

    def changed(part):
        slip, cause = part.slip, part.head("cause")
        assert Cause.GLITCH in cause.classes
        speed = Head(
            name="slip_speed", link="square", features=slip.features, rule=slip.rule, highest=40.0
        )
        return part.with_heads(speed)

    return normalised_model().changed(changed)


def handling_labelled(seed):
    made = handling_recording(seed, slip=0.4)
    labels = (
        Label(1.8, 5.0, ContactState.UNSTABLE, Cause.SLIP),
        Label(5.2, 9.0, ContactState.STABLE),
    )
    return made.with_labels(dict.fromkeys(made.modules, labels))


def begun(recording, *, loaded):
    name = f"{recording.name}-{loaded}"
    return dataclasses.replace(recording, name=name, metadata={"starts_loaded": loaded})


def heads_of(model, *left_out):
    return {
        finger: {head.name: head for head in part.heads if head.name not in left_out}
        for finger, part in model.fingers.items()
    }


@pytest.fixture(scope="module")
def model():
    made = full_model()
    assert set(heads_of(made)[ANY_FINGER]) == NAMES
    return made


@pytest.mark.parametrize("shared", [True, False])
def test_an_adapted_model_keeps_all_heads_but_that_of_stability(model, shared):
    few = [tiny_recording(seed) for seed in (50, 51)]
    adapted = train(few, Setting.adapting(model, trials=0, shared=shared)).model
    expected = heads_of(model, "stable")[ANY_FINGER]
    fingers = [ANY_FINGER] if shared else ["thumb", "index"]
    assert heads_of(adapted, "stable") == dict.fromkeys(fingers, expected)
    for part in adapted.fingers.values():
        assert part.stable.features == model.fingers[ANY_FINGER].stable.features
        assert part.stable != model.fingers[ANY_FINGER].stable


def test_an_adapted_model_has_the_own_handling_in_all_heads(model):
    own = calibrate(model, [handling_recording(k, held=12.0) for k in range(2)])
    few = [handling_labelled(seed) for seed in (3, 4)]
    sensor = few[0].modules["thumb"].sensor
    adapted = train(few, Setting.adapting(own, trials=0, shared=True)).model
    folded = own.with_handling_of({ANY_FINGER: sensor})
    assert heads_of(folded, "stable") != heads_of(model, "stable")
    assert heads_of(adapted, "stable") == heads_of(folded, "stable")


def test_a_calibrated_model_keeps_all_heads(model):
    calibrated = calibrate(model, [handling_recording(k, held=12.0) for k in range(2)])
    assert heads_of(calibrated) == heads_of(model)
    part = calibrated.fingers[ANY_FINGER]
    own = part.for_sensor("pad")
    assert {head.name for head in own.heads} == NAMES
    for head in own.heads:
        before = part.head(head.name)
        assert head.rule.weights == before.rule.weights
        # Slips are decided on features without a unit, which own handling leaves as they are.
        assert (head.rule.mean != before.rule.mean) == (head.name in ("stable", "cause"))
        assert head.features == before.features
    assert own.stable.threshold == part.handling["pad"].thresholds["stable"]
    assert own.slip.threshold == part.handling["pad"].thresholds["slip"]


@pytest.mark.parametrize(
    ("changed", "seeds", "tuned"),
    [("stable", (20, 21), lambda m, data: tune(m, data, 100.0).model),
     ("slip", range(20, 24), lambda m, data: tune(m, data, 20.0, "slip").model)],
)  # fmt: skip
def test_a_tuned_model_keeps_all_heads(model, changed, seeds, tuned):
    data = [sliding_recording(seed) for seed in seeds]
    found = tuned(model, data)
    assert heads_of(found, changed) == heads_of(model, changed)
    before, after = (m.fingers[ANY_FINGER].head(changed) for m in (model, found))
    assert after.choice.recordings == {made.name: made.readings_digest for made in data}
    assert replace(after, threshold=before.threshold, choice=before.choice) == before


@pytest.mark.parametrize(
    ("loaded", "heads", "line"),
    [((False, True), ["slip", "slip_changes"], ""),
     ((False,), ["slip"], "slip_changes keeps its threshold"),
     ((True,), ["slip_changes"], "slip keeps its threshold")],
)  # fmt: skip
def test_each_slip_head_is_tuned_by_the_recordings_on_which_it_decides(model, loaded, heads, line):
    data = [
        begun(sliding_recording(seed), loaded=starts_loaded)
        for starts_loaded in loaded
        for seed in range(20, 24)
    ]
    tuned = tune(model, data, 20.0, "slip")
    parts = [tuned, tuned.changes] if tuned.changes else [tuned]
    assert [part.head for part in parts] == heads
    assert tuned.other_head.startswith(line) and bool(tuned.other_head) == bool(line)
    part = tuned.model.fingers[ANY_FINGER]
    assert [part.head(name).threshold for name in heads] == [x.chosen.threshold for x in parts]


def caused_recording(seed, *causes):
    """Return a recording whose unstable second half has the causes, one after the other."""
    made = tiny_recording(seed)
    bounds = np.linspace(2.0, 4.0, len(causes) + 1)
    labels = (
        Label(0.0, 2.0, ContactState.STABLE),
        *(Label(a, b, ContactState.UNSTABLE, cause)
          for a, b, cause in zip(bounds[:-1], bounds[1:], causes, strict=True)),
    )  # fmt: skip
    return made.with_labels(dict.fromkeys(made.modules, labels))


CAUSES_OF = {
    "two": (Cause.DISTURBANCE, Cause.GLITCH),
    "alike": (Cause.DISTURBANCE, Cause.LOST, Cause.RELEASED),  # lost and released are one
    "slip": (Cause.DISTURBANCE, Cause.GLITCH, Cause.SLIP),  # a slip is no cause here
}


@pytest.mark.parametrize(
    ("causes", "classes"),
    [("two", {"disturbance", "glitch"}), ("alike", {"disturbance", "lost"}),
     ("slip", {"disturbance", "glitch"})],
)  # fmt: skip
def test_causes_are_trained_from_labels(causes, classes):
    recordings = [caused_recording(seed, *CAUSES_OF[causes]) for seed in (60, 61, 62)]
    trained = train(recordings, Setting(trials=0, window=6, features=FEATURES))
    for finger, part in trained.model.fingers.items():
        head = part.head("cause")
        assert set(head.classes) == classes
        rows, names = [], []
        for made in recordings:
            module = made.modules[finger]
            features = haar_features(fingertip_force(module.readings, TINY, 0.5, module.times), 6)
            for label in module.labels:
                cause = Cause.LOST if label.cause is Cause.RELEASED else label.cause
                if cause not in (None, Cause.SLIP):
                    first, last = np.searchsorted(module.times, (label.start, label.end))
                    rows.append(features[first:last])
                    names += [str(cause)] * (last - first)
        rule, _ = fit_causes(np.concatenate(rows), np.array(names), CAUSE_PENALTY)
        np.testing.assert_allclose(head.rule.weights, rule.weights, atol=1e-6)


def test_too_few_causes_are_a_warning():
    recordings = [caused_recording(seed, Cause.DISTURBANCE) for seed in (60, 61, 62)]
    warnings = []
    setting = Setting(trials=0, window=6, features=FEATURES, shared=True)
    model = train(recordings, setting, warn=warnings.append).model
    assert model.fingers[ANY_FINGER].head("cause") is None
    assert len(warnings) == 1 and "1200 of disturbance" in warnings[0]


def test_the_fit_is_that_of_scikit_learn_with_balanced_classes():
    draw = np.random.default_rng(0)
    index = draw.choice(3, p=[0.7, 0.2, 0.1], size=900)
    features = draw.normal(size=(900, 4)) + np.eye(3, 4)[index] + [1e3, 0.0, -5.0, 0.1]
    names = np.array([Cause.SLIP, Cause.GLITCH, Cause.CLOSING])[index].astype(str)
    found, classes = fit_causes(features, names, 0.5)
    standardised = (features - features.mean(axis=0)) / features.std(axis=0)
    peer = LogisticRegression(C=0.5, class_weight="balanced", tol=1e-12, max_iter=10_000)
    peer.fit(standardised, names)
    assert [str(cause) for cause in classes] == peer.classes_.tolist()
    np.testing.assert_allclose(found.weights, peer.coef_, atol=1e-6)
    np.testing.assert_allclose(found.intercepts, peer.intercept_, atol=1e-6)
