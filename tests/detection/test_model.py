import json
import os
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detection.detector.build import (
    RATE,
    RICH,
    TAXELS,
    finger_model,
    linear,
    model,
    recording,
    sensor,
    tactile,
)
from holdfast.contact import NO_CONTACT
from holdfast.detection import (
    ANY_FINGER,
    Debounce,
    FeatureSpec,
    Model,
    Training,
    detect,
    parse_features,
)
from holdfast.errors import ModelError, OutputError

TRAINING = Training(
    recordings={"one": "0a1b"},
    split="recording",
    parameters={"thumb": {"C": 0.1, "class_weight": "balanced"}},
    figures={"accuracy": 91.25, "auc": None},
    seed=3,
    versions={"numpy": "2.0"},
)
FULL = model(
    features=RICH, threshold=12.5, debounce=Debounce(0.05, 0.1), training=TRAINING, name="full"
)


WITH_SQUARES = model(features=RICH, slips=("thumb",), own=TAXELS)


def saved(hand_model, path):
    hand_model.save(path)
    return path


class TestTraining:
    @pytest.mark.parametrize("n", [1, 10, 1000])
    def test_blocks_make_a_file_a_fifth_larger_at_most(self, n, tmp_path):
        recordings = {f"grasp-{k}": f"{k:032x}" for k in range(n)}
        training = msgspec.structs.replace(TRAINING, recordings=recordings)
        own = np.random.default_rng(0).integers(2**64, size=(n, 1000), dtype=np.uint64)
        with_blocks = FULL.with_training(training, list(own))
        bare = msgspec.structs.replace(FULL, training=training)
        sizes = [saved(x, tmp_path / f"{x is bare}").stat().st_size for x in (with_blocks, bare)]
        assert sizes[0] <= 1.2 * sizes[1]
        assert all(with_blocks.training.has_any(blocks) for blocks in own)
        assert not bare.training.has_any(own[0])

    def test_without_blocks_a_file_is_as_before(self):
        assert b"blocks" not in FULL.encoded()

    @pytest.mark.parametrize("blocks", ["AAAA", "AAAAAAA", "A", 5])
    def test_blocks_are_whole(self, blocks, tmp_path):
        fields = json.loads(FULL.encoded())
        fields["training"]["blocks"] = blocks
        (tmp_path / "m.json").write_text(json.dumps(fields))
        with pytest.raises(ModelError, match=r"m\.json"):
            Model.load(tmp_path / "m.json")


class TestSaveAndLoad:
    @pytest.mark.parametrize(
        "hand_model", [FULL, Model.load("builtin:noise-floor"), model(), WITH_SQUARES]
    )
    def test_it_is_the_same(self, hand_model, tmp_path):
        assert Model.load(saved(hand_model, tmp_path / "m.json")) == hand_model

    @given(st.integers(0, 2**32), st.floats(0, 1), st.floats(0, 1e300))
    @settings(max_examples=30)
    def test_every_bit(self, seed, threshold, contact):
        part = finger_model(None, seed, threshold=threshold, contact_threshold=contact)
        hand_model = Model(fingers={ANY_FINGER: part}, rate=1 / 3)
        assert msgspec.json.decode(msgspec.json.encode(hand_model), type=Model) == hand_model

    def test_step_and_rest_of_a_sensor_are_kept(self, tmp_path):
        plain = Model(fingers={ANY_FINGER: finger_model()}, sensors={"thumb": sensor()})
        assert b'"step"' not in plain.encoded()
        stepped = {"thumb": replace(sensor(), step=0.5, rests_at_zero=True)}
        loaded = Model.load(saved(msgspec.structs.replace(plain, sensors=stepped), tmp_path / "m"))
        assert loaded.sensors == stepped

    def test_nothing_is_overwritten(self, tmp_path):
        path = saved(FULL, tmp_path / "m.json")
        with pytest.raises(OutputError):
            model().save(path)
        assert Model.load(path) == FULL
        model().save(path, force=True)
        assert Model.load(path) == model()

    def test_not_over_a_name(self):
        with pytest.raises(OutputError, match="builtin:mine"):
            FULL.save("builtin:mine")


def change(path, *keys):
    """The plain data of a saved model, and the part of it that the keys lead to."""
    data = json.loads(path.read_text())
    part = data
    for key in keys:
        part = part[key]
    return data, part


DEEP = b"[" * 100_000

HEAD = {
    "name": "stable", "link": "logit", "features": [{"kind": "F_a"}],
    "rule": {"type": "linear", "mean": [0], "scale": [1], "weights": [[1]], "intercepts": [0]},
}  # fmt: skip
ANY = {"heads": [HEAD]}
STABLE = ("fingers", "thumb", "heads", 0)
RULE = (*STABLE, "rule")


def head_of(n_features, name="stable", **fields):
    """A head of some features, in plain data."""
    rule = HEAD["rule"] | {
        "mean": [0] * n_features, "scale": [1] * n_features, "weights": [[1] * n_features]
    }  # fmt: skip
    features = [{"kind": "sigma", "window": 2 * k + 4} for k in range(n_features)]
    return HEAD | {"name": name, "features": features, "rule": rule} | fields


CHANGES = {
    **{
        f"extra field of {keys}": (keys, {"colour": 1}, "colour")
        for keys in (
            (),
            ("fingers", "thumb"),
            STABLE,
            RULE,
            (*STABLE, "features", 0),
            ("sensors", "tiny"),
        )
    },
    "schema": ((), {"schema": "holdfast.model/1"}, "holdfast.model/1"),
    "name of a head": (STABLE, {"name": "rolls"}, "rolls"),
    "link of a head": (STABLE, {"link": "probit"}, "probit"),
    "link of another head": (STABLE, {"link": "square"}, "stable"),
    "a name twice": (("fingers", "thumb"), {"heads": [HEAD, HEAD]}, "stable, stable"),
    "no head of stability": (("fingers", "thumb"), {"heads": [HEAD | {"name": "slip"}]}, "stable"),
    "width of a head": (STABLE, {"features": [{"kind": "F_a"}]}, "stable"),
    "kind of rule": (RULE, {"type": "forest"}, "forest"),
    "kind of feature": ((*STABLE, "features", 0), {"kind": "F_q"}, "F_q"),
    "odd window": ((*STABLE, "features", 4), {"window": 7}, "7 given"),
    "weights": (RULE, {"mean": [0.0]}, "1, 15, 15 features"),
    "text": (RULE, {"intercepts": ["high"]}, "float"),
    "null": (RULE, {"intercepts": [None]}, "float"),
    "scale": (RULE, {"scale": [0.0] * len(RICH)}, "scales"),
    "rate": ((), {"rate": -1.0}, "rate"),
    "tare": ((), {"tare": "soon"}, "'soon'"),
    "window": ((), {"window": 5}, "window"),
    "hysteresis": (("debounce",), {"hysteresis": 2.0}, "hysteresis"),
    "no fingers": ((), {"fingers": {}}, "finger"),
    "unknown sensor": (("fingers", "thumb"), {"sensor": "skin"}, "'skin'"),
    "a sensor's shape": (("sensors", "tiny"), {"positions": [[0.0, 1.0]]}, "positions of tiny"),
    "a sensor's rotation": (
        ("sensors", "tiny"),
        {"rotations": [np.zeros((3, 3)).tolist()] * 2},
        "rotation",
    ),
    "no sensor": (("sensors",), {"tiny": 5}, "sensor"),
    "huge window": ((*STABLE, "features", 4), {"window": 10**9}, "65536"),
    "window beyond 64 bits": ((), {"window": 2**63}, "65536"),
    "window beyond all": ((), {"window": 2**90}, ""),
    "window with a fraction": ((), {"window": 1e308}, "int"),
    "huge rate": ((), {"rate": 1e308}, "1000000"),
    "rate without end": ((), {"rate": 10**400}, ""),
    "a sensor's rate": (("sensors", "tiny"), {"rate": 1e308}, "tiny"),
    "a sensor's rate without end": (("sensors", "tiny"), {"rate": 10**400}, ""),
    "many fingers": ((), {"sensors": {}, "fingers": {f"f{k}": ANY for k in range(300)}}, "300"),
    "many features": (("fingers", "thumb"), {"heads": [head_of(2000)]}, "2000"),
    "many features of two heads": (
        ("fingers", "thumb"),
        {"heads": [head_of(600), head_of(1100, "slip")]},
        "1100",
    ),
    "many taxels": (
        ("sensors", "tiny"),
        {"positions": [[0.0] * 3] * 5000, "rotations": [np.eye(3).tolist()] * 5000},
        "5000",
    ),
    "a sensor's positions": (("sensors", "tiny"), {"positions": None}, "positions"),
}


@pytest.mark.parametrize(("keys", "new", "message"), CHANGES.values(), ids=CHANGES)
def test_refuses_to_load(keys, new, message, tmp_path):
    path = saved(FULL, tmp_path / "m.json")
    data, part = change(path, *keys)
    part.update(new)
    path.write_text(json.dumps(data))
    with pytest.raises(ModelError) as raised:
        Model.load(path)
    text = str(raised.value)
    assert text.startswith(f"{path} ")
    assert message in text
    assert "\n" not in text


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"])
@pytest.mark.parametrize(
    "keys",
    [("rate",), (*RULE, "intercepts", 0), ("sensors", "tiny", "rate")],
)
def test_refuses_numbers_that_are_not_finite(number, keys, tmp_path):
    path = saved(FULL, tmp_path / "m.json")
    data, part = change(path, *keys[:-1])
    part[keys[-1]] = 123454321.0
    path.write_text(json.dumps(data).replace("123454321.0", number))
    with pytest.raises(ModelError, match=r"m\.json"):
        Model.load(path)


@pytest.mark.parametrize(
    "content", [b"", b"\x80\x04pickle", b"[1]", b"null", b"{}", b"{", b"5", DEEP]
)
def test_refuses_other_files(content, tmp_path):
    path = tmp_path / "m.json"
    path.write_bytes(content)
    with pytest.raises(ModelError, match=r"m\.json"):
        Model.load(path)


def test_refuses_a_missing_file(tmp_path):
    with pytest.raises(ModelError, match=r"m\.json: No such file"):
        Model.load(tmp_path / "m.json")


def test_refuses_an_unknown_name():
    with pytest.raises(ModelError, match=r"builtin:magic'.* builtin:any"):
        Model.load("builtin:magic")


class TestFingers:
    def test_features_and_rule_fit(self):
        with pytest.raises(ModelError, match="stable: 1 features"):
            finger_model((FeatureSpec("F_a"),), rule=linear(2))

    @pytest.mark.parametrize("name", ["contact_threshold", "contact_noise"])
    @pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
    def test_thresholds(self, name, value):
        with pytest.raises(ModelError, match="contact threshold"):
            finger_model(**{name: value})

    def test_any_finger_has_no_others(self):
        with pytest.raises(ModelError, match="thumb"):
            Model(fingers={ANY_FINGER: finger_model(), "thumb": finger_model()})

    def test_an_unknown_finger(self):
        with pytest.raises(ModelError, match="'ring'"):
            model().finger("ring")

    def test_fingertips_only_where_there_are_any(self):
        hand_model, which = Model(fingers={ANY_FINGER: finger_model()}), sensor()
        assert list(hand_model.fingers_of({"index": which, "index/1": which})) == ["index"]
        assert list(hand_model.fingers_of({"index/1": which, "palm/1": which})) == [
            "index/1",
            "palm/1",
        ]

    def test_fingers_that_the_hand_lacks_are_kept(self):
        assert list(model().fingers_of({"index": sensor()})) == ["thumb", "index"]

    def test_another_sensor(self):
        with pytest.raises(ModelError, match=r"index: 3 taxels .*builtin:any"):
            model().predict_proba(recording(index=tactile(which=sensor(3, "big"))))

    def test_readings_in_another_unit_or_turned_taxels(self):
        known = sensor()
        newtons = replace(known, unit="N")
        with pytest.raises(ModelError, match=r"thumb: .* N given"):
            model().fingers_of({"thumb": newtons})
        turned = replace(known, rotations=known.rotations[:, [1, 2, 0]])
        with pytest.raises(ModelError, match=r"thumb: .* rotations"):
            model().fingers_of({"thumb": turned})

    def test_any_finger_of_its_sensor(self):
        part = finger_model(sensor="tiny")
        hand_model = Model(fingers={ANY_FINGER: part}, sensors={"tiny": sensor()})
        assert list(hand_model.fingers_of({"a": sensor(), "b": sensor(3, "big")})) == ["a"]
        with pytest.raises(ModelError, match=r"'tiny'; given are b \(big\)"):
            hand_model.fingers_of({"b": sensor(3, "big")})


class TestPredictProba:
    def test_a_number_for_each_sample(self):
        made = recording(thumb=tactile(150, seed=1), index=tactile(90, seed=2, start=0.002))
        found = FULL.predict_proba(made)
        assert {finger: p.shape for finger, p in found.items()} == {"thumb": (150,), "index": (90,)}
        for probability in found.values():
            known = probability[np.isfinite(probability)]
            assert len(known) > 30
            assert ((known >= 0) & (known <= 1)).all()

    @pytest.mark.parametrize("threshold", [None, 30.0])
    def test_equals_detect_but_for_no_contact(self, threshold):
        made = recording(thumb=tactile(seed=1), index=tactile(seed=2, start=0.002))
        hand_model = model(features=RICH, threshold=threshold)
        found = hand_model.predict_proba(made)
        for finger, trace in detect(hand_model, made).fingers.items():
            touching = trace.state != NO_CONTACT
            assert np.array_equal(
                found[finger][touching], trace.stable_probability[touching], equal_nan=True
            )
            assert touching.all() or threshold is not None


def test_the_noise_floor():
    hand_model = Model.load("builtin:noise-floor")
    part = hand_model.fingers[ANY_FINGER]
    assert part.features == (FeatureSpec("sigma", 14, "noise"),)
    at = part.stable.rule.probability(np.log([[1.0], [3.0], [9.0]]))
    assert at == pytest.approx([0.9, 0.5, 0.1])


class TestTwin:
    """`builtin:twin`, trained on simulated recordings."""

    def test_it_has_its_provenance(self):
        hand_model = Model.load("builtin:twin")
        assert hand_model.name == "builtin:twin"
        assert hand_model.training is not None
        assert (
            len(hand_model.training.recordings)
            == len(set(hand_model.training.recordings.values()))
            == 145  # 60 of the stability, 85 of the slip rule
        )
        assert all(len(digest) == 32 for digest in hand_model.training.recordings.values())
        assert hand_model.training.figures["accuracy"] > 90


def test_the_plan_takes_the_models_rate():
    sensors = {"thumb": sensor()}
    assert model().plan(sensors, 90.0).rate == RATE
    assert Model(fingers={ANY_FINGER: finger_model()}).plan(sensors, 90.0).rate == 90.0
    assert model().plan(sensors, 90.0).features["thumb"] == parse_features(
        "F_a,F_x,F_y,F_z,sigma", 6
    )


def test_a_key_that_is_given_twice_is_refused(tmp_path):
    path = saved(FULL, tmp_path / "m.json")
    text = path.read_text()
    path.write_text(text.replace('"rate":', '"rate": 100.0, "rate":', 1))
    with pytest.raises(ModelError, match="'rate'"):
        Model.load(path)
    path.write_text(text.replace('"tare":', '"tare": "first", "t\\u0061re":', 1))
    with pytest.raises(ModelError, match="'tare'"):
        Model.load(path)


def test_a_large_file_and_a_pipe_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(ModelError, match="pipe"):
            Model.load(path)
    with (tmp_path / "large").open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(ModelError, match="16777216"):
        Model.load(tmp_path / "large")


def test_the_ranges_of_an_older_model_are_called_limits(tmp_path):
    text = Model.load("builtin:twin").encoded().replace(b'"range":[', b'"limits":[')
    assert b'"limits":[' in text
    (tmp_path / "older.json").write_bytes(text)
    older = Model.load(tmp_path / "older.json")
    assert older.sensors == Model.load("builtin:twin").sensors


def test_a_model_that_reports_no_slip_says_what_to_do():
    reporting = model(slips=("thumb",), own=TAXELS, name="mine")
    assert reporting.reports_slips
    silent = reporting.with_threshold("slip", 1.0)
    assert not silent.reports_slips
    assert silent.has_slip_rule
    assert "holdfast teach" in silent.slip_advice
    assert "holdfast calibrate" in Model.load("builtin:any").slip_advice
    assert reporting.slip_advice == model().slip_advice == ""
