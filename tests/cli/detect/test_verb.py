import json
import os
import re
import signal
from dataclasses import replace

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.cli.detect.estimates import CHUNK_SIZE
from holdfast.contact import UNSTABLE, Fault
from holdfast.detection import Debounce, FeatureSpec, FingerModel, Head, Linear, Model, detect
from holdfast.devices.sources import open_source
from holdfast.io import load_recording, save_recording
from holdfast.live.publishers.xela_server import XelaServer
from holdfast.live.stream_detector import StreamDetector
from holdfast.metrics.masks import runs
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

FIELDS = [
    "time", "finger", "state", "reason", "stable_probability", "instability", "force", "faults",
    "faulty_taxels", "cause", "slip_probability", "slip_speed", "slip_distance",
]  # fmt: skip
NOISE_FLOOR = "builtin:noise-floor"
SIGMA = (FeatureSpec("sigma", 14),)


def finger_model(name):
    stable = Head(name="stable", link="logit", features=SIGMA, rule=rule_of_sigma(-2.0, 0.0))
    return FingerModel(heads=(stable,), sensor=name, contact_threshold=50.0)


def rule_of_sigma(weight, intercept):
    return Linear((10.0,), (3.0,), ((weight,),), (intercept,))


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A model's file: thumb and index with curved uSkin fingertips at 150 Hz."""
    curved = sensor("uskin-curved")
    path = tmp_path_factory.mktemp("model") / "model.json"
    Model(
        fingers={name: finger_model("uskin-curved") for name in ("thumb", "index")},
        sensors={"uskin-curved": curved},
        rate=150.0,
    ).save(path)
    return path


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    """A long grasp, in which the index starts later and has other times."""
    one = synthetic_recording("grasp", 1, ("thumb", "index"))
    n = 2 * CHUNK_SIZE // one.modules["thumb"].n_samples + 1
    modules = {}
    for name, skipped in (("thumb", 0), ("index", CHUNK_SIZE + 300)):
        m = one.modules[name]
        readings = np.concatenate([m.readings] * n)
        times = np.arange(len(readings)) / 150 + (0.002 if skipped else 0)
        modules[name] = Tactile(m.sensor, times[skipped:], readings[skipped:])
    path = tmp_path_factory.mktemp("grasp") / "grasp.parquet"
    save_recording(Recording("grasp", modules), path)
    return path


@pytest.fixture
def save(tmp_path):
    def write(recording, name="a.parquet"):
        save_recording(recording, tmp_path / name)
        return tmp_path / name

    return write


VERB = Verb("detect")


def lines(capsys, *words):
    """Return the lines, and the messages but the one about a missing slip rule."""
    code, out, err = VERB.run(capsys, *words)
    assert code == 0
    err = re.sub(r"^.* has no slip rule.*\n", "", err, flags=re.MULTILINE)
    return [json.loads(line) for line in out.splitlines()], err


def summary(capsys, *words):
    return VERB.document(capsys, *words, "--summary")


def test_lines_equal_the_result_of_detect(capsys, model, grasp):
    """Reading in chunks gives the same lines; one per finger and sample, in the order of time."""
    got, err = lines(capsys, model, grasp)
    assert err == ""
    assert list(got[0]) == FIELDS
    assert [line["time"] for line in got] == sorted(line["time"] for line in got)
    want = detect(Model.load(model), load_recording(grasp))
    for finger, trace in want.fingers.items():
        mine = [line for line in got if line["finger"] == finger]
        assert [line["time"] for line in mine] == trace.times.tolist()
        assert [line["state"] for line in mine] == [
            str(trace.estimate(k).state) for k in range(len(trace))
        ]
        given = [x["stable_probability"] for x in mine]
        np.testing.assert_array_equal(np.array(given, float), trace.stable_probability)
    assert len(got) == sum(len(trace) for trace in want.fingers.values())
    assert {"STABLE", "UNSTABLE", "NO_CONTACT", "UNKNOWN"} == {line["state"] for line in got}


def test_label_files_are_not_read_and_fingers_keep_their_order(capsys, save):
    path = save(synthetic_recording("a", 1, ("thumb", "index")))
    path.with_name("a.labels.json").write_text("damaged")
    got, _ = lines(capsys, NOISE_FLOOR, path)
    assert [line["finger"] for line in got[:4]] == ["thumb", "index", "thumb", "index"]
    assert (got[0]["reason"], got[0]["force"]) == ("tare", [None, None, None])


def test_a_cut_file_is_used(capsys, save):
    path = save(synthetic_recording("a", 1, ("thumb",)), "a.mcap")
    path.write_bytes(path.read_bytes()[:60_000])
    got, err = lines(capsys, NOISE_FLOOR, path)
    assert got
    assert err.startswith(f"{path} is cut off") and err.count("\n") == 1


class TestSummary:
    def test_shares_and_events(self, capsys, model, grasp):
        document = summary(capsys, model, grasp)
        want = detect(Model.load(model), load_recording(grasp))
        assert list(document) == ["model", "name", "fingers", "hand", "events", "slips"]
        assert document["slips"] is None
        assert (document["model"], document["name"]) == (str(model), "grasp")
        for finger, trace in want.fingers.items():
            shares = document["fingers"][finger]
            assert shares["n_samples"] == len(trace)
            assert sum(shares["states"].values()) == pytest.approx(1)
            assert shares["states"]["STABLE"] == np.mean(trace.state == 3)
            assert sum(shares["reasons"].values()) == np.sum(trace.state == 0)
            changes = np.flatnonzero(np.diff(trace.state, prepend=0))
            events = [event for event in document["events"] if event["finger"] == finger]
            assert [event["time"] for event in events] == trace.times[changes].tolist()
        hand = [event for event in document["events"] if event["finger"] == "hand"]
        assert len(hand) == np.count_nonzero(np.diff(want.hand, prepend=0))
        assert document["hand"]["states"]["UNSTABLE"] == np.mean(want.hand == 2)

    def test_options_change_the_debouncing_of_the_model(self, capsys, model, grasp, tmp_path):
        held = msgspec.structs.replace(Model.load(model), debounce=Debounce(0.3, 0.2, 0.4))
        held.save(tmp_path / "held.json")
        recording = load_recording(grasp)
        for words, debounce in {
            (): held.debounce,
            ("--debounce", 0): Debounce(0.0, 0.2, 0.4),
            ("--hysteresis", 0.1): Debounce(0.3, 0.1, 0.4),
        }.items():
            chosen = msgspec.structs.replace(held, debounce=debounce)
            unstable = np.mean(detect(chosen, recording).fingers["thumb"].state == UNSTABLE)
            document = summary(capsys, tmp_path / "held.json", grasp, *words)
            got = document["fingers"]["thumb"]["states"]["UNSTABLE"]
            assert got == pytest.approx(unstable, abs=1e-6)


def with_slip_rule(model, fingers=("thumb", "index")):
    """Return a model whose fingers slide where sigma is over 13; the rule has no hold."""
    slip = Head(name="slip", link="logit", features=SIGMA, rule=rule_of_sigma(2.0, -2.0))
    parts = {
        name: part.with_heads(slip) if name in fingers else part.without_heads("slip")
        for name, part in model.fingers.items()
    }
    return msgspec.structs.replace(model, fingers=parts)


class TestSlips:
    """A slip is an event of its own: it begins and ends, whatever the state is."""

    def test_a_model_without_a_slip_rule_says_so_once(self, capsys, model, grasp, tmp_path):
        path = tmp_path / "half.json"
        with_slip_rule(Model.load(model), ["thumb"]).save(path)
        for name, fingers in ((model, ""), (path, " for index")):
            assert main(["detect", str(name), str(grasp)]) == 0
            out, err = capsys.readouterr()
            assert err.startswith(f"{name} has no slip rule{fingers}: ") and err.count("\n") == 1
        got = [json.loads(line) for line in out.splitlines()]
        assert {x["slip_probability"] for x in got if x["finger"] == "index"} == {None}
        assert any(x["slip_probability"] for x in got if x["finger"] == "thumb")

    @pytest.fixture
    def sliding(self, model, tmp_path):
        path = tmp_path / "slips.json"
        with_slip_rule(Model.load(model)).save(path)
        return path

    @pytest.fixture
    def want(self, sliding, grasp):
        """Slips by finger: first sample, first sample after it or None, largest probability."""
        slips = {}
        for name, trace in detect(Model.load(sliding), load_recording(grasp)).fingers.items():
            times, values = [*trace.times, None], trace.slip_probability
            found = runs(values >= 0.5)
            slips[name] = [(times[a], times[b], values[a:b].max()) for a, b in found]
        return slips

    def test_a_threshold_of_1_is_said_where_a_slip_would_be_shown(
        self, capsys, sliding, grasp, tmp_path
    ):
        path = tmp_path / "silent.json"
        Model.load(sliding).with_threshold("slip", 1.0).save(path)
        assert main(["detect", str(path), str(grasp), "--summary"]) == 0
        out, err = capsys.readouterr()
        assert out.endswith("\nno slips\n")
        assert str(path) in err and "holdfast teach" in err
        got, err = lines(capsys, path, grasp)
        assert err == ""
        assert any(x["slip_probability"] for x in got)

    def test_the_summary_has_begin_end_and_probability(self, capsys, sliding, grasp, want):
        slips = summary(capsys, sliding, grasp)["slips"]
        assert [slip["begin"] for slip in slips] == sorted(slip["begin"] for slip in slips)
        for finger, expected in want.items():
            got = [slip for slip in slips if slip["finger"] == finger]
            assert [(x["begin"], x["end"], x["max_probability"]) for x in got] == expected
            assert len(got) > 5
        assert main(["detect", str(sliding), str(grasp), "--summary"]) == 0
        begin, end, probability = want["thumb"][0]
        row = [f"{begin:.3f}", f"{end:.3f}", "thumb", f"{100 * probability:.0f}", "-"]
        assert row in [line.split() for line in capsys.readouterr().out.splitlines()]

    def test_a_speed_rule_gives_the_distance(self, capsys, sliding, grasp, tmp_path):
        model, path = Model.load(sliding), tmp_path / "speed.json"
        rule = rule_of_sigma(1.0, 2.0)
        speed = Head(name="slip_speed", link="square", features=SIGMA, rule=rule, highest=50.0)
        model.changed(lambda part: part.with_heads(speed)).save(path)
        got, _ = lines(capsys, path, grasp)
        for line in got:
            assert (line["slip_speed"] is None) == (line["state"] == "UNKNOWN")
            assert ((line["slip_speed"] or 0) > 0) == (line["cause"] == "slip")
        ended = [slip for slip in summary(capsys, path, grasp)["slips"] if slip["end"]]
        assert len(ended) > 5
        for slip in ended:
            mine = [line for line in got if line["finger"] == slip["finger"]]
            during = [x for x in mine if slip["begin"] <= x["time"] < slip["end"]]
            distance = sum(line["slip_speed"] for line in during) / 150
            assert slip["distance"] == pytest.approx(distance, rel=1e-6)

    def test_a_terminal_shows_begin_and_end(self, capsys, monkeypatch, sliding, grasp, want):
        monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
        assert main(["detect", str(sliding), str(grasp)]) == 0
        rows = capsys.readouterr().out.splitlines()[1:]
        slips = [row for row in rows if " slip begins " in row or " slip ends " in row]
        assert len(slips) == sum((end is not None) + 1 for s in want.values() for _, end, _ in s)
        assert all(len(row) <= 80 for row in slips)
        begin, end, probability = want["thumb"][0]
        begins_with = f"{end:9.3f} s  thumb           slip ends"
        (last,) = [row for row in slips if row.startswith(begins_with)]
        lasted = f"{end - begin:.3f} s, largest P(slip) {100 * probability:.0f} %"
        assert last.endswith(lasted)


def test_taxels_are_counted_from_1_as_in_the_columns_of_files(capsys, model, save):
    recording = synthetic_recording("spoilt", 1, ("index",))
    module = recording.modules["index"]
    path = save(Recording("spoilt", {"index": module}), "whole.parquet")
    columns = [name for name in pq.read_schema(path).names if name.endswith(".x")]
    assert "index.t00.x" not in columns
    readings = module.readings.astype(float)
    for column in ("index.t01.x", "index.t07.x", "index.t30.x"):
        readings[300:, columns.index(column)] = np.nan
    path = save(Recording("spoilt", {"index": replace(module, readings=readings)}))
    got, _ = lines(capsys, model, path)
    assert {tuple(line["faulty_taxels"]) for line in got[320:]} == {(1, 7, 30)}
    assert got[320]["faults"] == [Fault.NOT_FINITE]
    got, _ = lines(capsys, model, path, "--ignore", "index:1,index:7,index:30")
    assert {(*line["faulty_taxels"], *line["faults"]) for line in got} == {()}


def test_another_rate_is_resampled_with_a_message(capsys, model, save):
    recording = synthetic_recording("slow", 1, ("thumb", "index"))
    modules = {
        name: replace(m, times=m.times[::2], readings=m.readings[::2], labels=())
        for name, m in recording.modules.items()
    }
    slow = save(replace(recording, modules=modules))
    got, err = lines(capsys, model, slow)
    assert "75 Hz" in err and err.count("\n") == 1
    times = [line["time"] for line in got if line["finger"] == "thumb"]
    assert times == detect(Model.load(model), load_recording(slow)).fingers["thumb"].times.tolist()


def test_missing_fingers_are_reported(capsys, model, save):
    path = save(synthetic_recording("one", 1, ("index",)))
    got, err = lines(capsys, model, path)
    assert {line["finger"] for line in got} == {"index"}
    assert "thumb" in err and err.count("\n") == 1


@pytest.mark.parametrize("number", [None, signal.SIGINT, signal.SIGTERM])
def test_a_live_source_ends_after_its_seconds_or_by_a_signal(capsys, monkeypatch, save, number):
    grasp = save(synthetic_recording("a", 1, ("thumb", "index")))
    read, estimates = StreamDetector.read, []

    def read_and_signal(stream):
        update = read(stream)
        before = len(estimates)
        estimates.extend(update.estimates)
        if number and before < 100 <= len(estimates):  # samples of both fingers have come
            os.kill(os.getpid(), number)
        return update

    monkeypatch.setattr(StreamDetector, "read", read_and_signal)
    with (
        open_source(str(grasp), speed=1.5, loop=True) as source,
        XelaServer(source, port=0) as server,
    ):
        if number is None:
            got, _ = lines(capsys, NOISE_FLOOR, server.uri, "--seconds", "1")
            assert list(got[0]) == FIELDS
            monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
            _, out, _ = VERB.run(capsys, NOISE_FLOOR, server.uri, "--seconds", "4")
            assert {row.split()[2].rstrip(",") for row in out.splitlines()[1:]} >= {"thumb"}
        else:
            assert set(summary(capsys, NOISE_FLOOR, server.uri)["fingers"]) == {"thumb", "index"}


def test_a_terminal_shows_the_changes_that_lasted(capsys, monkeypatch, save):
    grasp = save(synthetic_recording("a", 1, ("thumb", "index")))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    assert main(["detect", NOISE_FLOOR, str(grasp)]) == 0
    _, *rows = capsys.readouterr().out.splitlines()
    times = [float(row.split()[0]) for row in rows]
    assert times == sorted(times)
    assert {row.split()[2].rstrip(",") for row in rows} >= {"thumb", "index"}
    assert 3 <= len(rows) < 100  # of 3450 estimates
    assert all(len(row) <= 80 for row in rows)
    assert main(["detect", NOISE_FLOOR, str(grasp), "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[0])["finger"] == "thumb"


def test_a_person_reads_no_times_since_1970(capsys, save):
    whole = synthetic_recording("a", 1, ("thumb", "index"))
    modules = {
        name: Tactile(m.sensor, m.times + 1795364053.99, m.readings)
        for name, m in whole.modules.items()
    }
    grasp = save(replace(whole, modules=modules))
    assert summary(capsys, NOISE_FLOOR, grasp)["events"][0]["time"] > 1795364053
    assert main(["detect", NOISE_FLOOR, str(grasp), "--summary"]) == 0
    rows = capsys.readouterr().out.splitlines()
    start = next(k for k, row in enumerate(rows) if "1795364053.990 s" in row)
    assert 0 < float(rows[start + 2].split()[0]) < 12
