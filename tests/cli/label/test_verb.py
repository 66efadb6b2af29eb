import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from urllib.request import Request, urlopen

import pytest

from holdfast.cli import main
from holdfast.cli.label import page_mode
from holdfast.cli.label.inputs import Asking
from holdfast.contact import ContactState
from holdfast.io import labels_path, load_labels, load_recording, save_labels, save_recording
from holdfast.labelling.review.audit import Audit, Suspect
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording

PATIENCE = 60.0
FINGERS = ("thumb", "index")


@pytest.fixture
def folder(tmp_path):
    """Two recordings with labels inside, one of them MCAP."""
    place = tmp_path / "recordings"
    place.mkdir()
    for name, seed, suffix in (("one", 0, ".parquet"), ("two", 1, ".mcap")):
        save_recording(synthetic_recording(name, seed, FINGERS), place / f"{name}{suffix}")
    return place


def run(capsys, *words):
    code = main(["label", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def told(capsys, *words):
    """The JSON of a run that goes well."""
    code, out, err = run(capsys, *words, "--json")
    assert code == 0, err
    return json.loads(out)


def refused(capsys, *words):
    """The one line of a run that is refused."""
    code, out, err = run(capsys, *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    return err.removeprefix("holdfast: ").rstrip("\n")


def by_hand(path, author="ada", notes="careful"):
    """The labels inside a recording, saved as a person's."""
    recording = load_recording(path, labels=False)
    signed = {
        name: [replace(label, author=author) for label in module.labels]
        for name, module in recording.modules.items()
    }
    save_labels(recording.with_labels(signed), path, author=author, notes=notes, force=True)


def test_a_rule_labels_a_folder(capsys, folder):
    found = told(capsys, "--auto", "signal", folder)
    assert (found["rule"], found["written"]) == ("signal", True)
    assert [each["name"] for each in found["recordings"]] == ["one", "two"]
    for each in found["recordings"]:
        file = load_labels(each["file"])
        assert file.author == "rule:signal"
        assert file.time
        recording = load_recording(each["path"])
        for finger, own in each["labels"].items():
            labels = recording.modules[finger].labels
            assert [label.start for label in labels] == [one["start"] for one in own]
            assert {label.author for label in labels} == {"rule:signal"}
        total = sum(x.end - x.start for m in recording.modules.values() for x in m.labels)
        assert sum(each["seconds"].values()) == pytest.approx(total)
        doubts = [one["confidence"] for one in each["doubtful"]]
        assert doubts == sorted(doubts)
        assert all(value < 0.8 for value in doubts)


def test_a_person_is_told_what_a_rule_did(capsys, folder):
    code, out, err = run(capsys, "--auto", "signal", folder)
    assert code == 0
    header, one, two = out.splitlines()[:3]
    assert header.split() == [
        "recording", "stable", "[s]", "unstable", "[s]", "no", "contact", "[s]", "doubtful",
    ]  # fmt: skip
    assert (one.split()[0], two.split()[0]) == ("one", "two")
    assert err == (
        "2 of 2 recordings have labels inside as well: the label files count while they are there\n"
    )


def test_a_dry_run_writes_nothing(capsys, folder):
    before = sorted(folder.iterdir())
    found = told(capsys, "--auto", "signal", folder, "--dry-run")
    assert found["written"] is False
    assert found["recordings"][0]["labels"]["thumb"]
    assert sorted(folder.iterdir()) == before


def test_a_rule_may_label_again_but_not_over_a_person(capsys, folder):
    path = folder / "one.parquet"
    told(capsys, "--auto", "signal", path)
    told(capsys, "--auto", "signal", path, "--author", "rule:mine")
    assert load_labels(labels_path(path)).author == "rule:mine"
    by_hand(path)
    before = labels_path(path).read_bytes()
    line = refused(capsys, "--auto", "signal", folder)
    assert line == (
        f"{labels_path(path)}: labels of ada are there already; nothing was written: "
        "--force replaces them"
    )
    assert labels_path(path).read_bytes() == before
    assert not labels_path(folder / "two.mcap").exists()
    told(capsys, "--auto", "signal", path, "--dry-run")
    assert labels_path(path).read_bytes() == before
    told(capsys, "--auto", "signal", folder, "--force")
    file = load_labels(labels_path(path))
    assert (file.author, file.notes) == ("rule:signal", "careful")


def test_recordings_that_a_rule_cannot_label_do_not_stop_the_others(capsys, folder):
    (folder / "cut.parquet").write_bytes((folder / "one.parquet").read_bytes()[:500])
    code, out, err = run(capsys, "--auto", "signal", folder, "--json")
    assert code == 2
    first, *others = json.loads(out)["recordings"]
    assert "cut.parquet is cut or damaged" in first["error"]
    assert err.splitlines()[-1] == f"holdfast: {first['error']}"
    assert [labels_path(each["path"]).exists() for each in others] == [True, True]


def test_parameters_of_a_rule(capsys, folder):
    path = folder / "one.parquet"
    usual = told(capsys, "--auto", "signal", path, "--dry-run")
    blunt = told(capsys, "--auto", "signal", path, "--dry-run", "--set", "share=0.9")
    assert blunt["recordings"][0]["seconds"] != usual["recordings"][0]["seconds"]
    poses = folder.parent / "poses.csv"
    rows = "".join(f"{k / 100},0,0,0,1,0,0,{1e-9 * (k % 2)}\n" for k in range(1200))
    poses.write_text("time,x,y,z,qw,qx,qy,qz\n" + rows)
    found = told(capsys, "--auto", "tracking", path, "--poses", poses)
    assert found["recordings"][0]["seconds"]["stable"] > 1


def test_agreement_of_a_folder_with_itself_and_with_a_rule(capsys, folder):
    same = told(capsys, "--compare", folder, folder)
    assert [each["name"] for each in same["recordings"]] == ["one", "two"]
    for each in same["recordings"]:
        assert {name: one["kappa"] for name, one in each["fingers"].items()} == {
            "thumb": 1.0, "index": 1.0,
        }  # fmt: skip
    assert same["left_out"] == {}
    rule = told(capsys, "--compare", folder, "signal")
    kappas = [one["kappa"] for each in rule["recordings"] for one in each["fingers"].values()]
    assert all(0.5 < kappa <= 1 for kappa in kappas)
    assert rule["pooled"]["kappa"] == pytest.approx(sum(kappas) / 4, abs=0.1)
    other = told(capsys, "--compare", "signal", folder)
    assert other["pooled"]["kappa"] == rule["pooled"]["kappa"]


def test_agreement_of_label_files(capsys, folder):
    path, eve = folder / "one.parquet", folder.parent / "eve"
    by_hand(path)
    eve.mkdir()
    shifted = {
        name: [
            replace(label, start=label.start + 0.1, end=label.end + 0.1) if label.end < 11 else
            replace(label, start=label.start + 0.1)
            for label in module.labels
        ]
        for name, module in load_recording(path).modules.items()
    }  # fmt: skip
    save_labels(load_recording(path).with_labels(shifted), eve / "one.parquet", author="eve")
    found = told(capsys, "--compare", labels_path(path), eve / "one.labels.json")
    thumb = found["recordings"][0]["fingers"]["thumb"]
    assert 0.5 < thumb["kappa"] < 1
    assert thumb["onset_differences"]["median"] == pytest.approx(0.1)
    folders = told(capsys, "--compare", folder, eve)
    assert folders["recordings"] == found["recordings"]
    assert list(folders["left_out"]) == ["two"]
    code, out, err = run(capsys, "--compare", eve, folder)
    assert code == 0
    assert out.splitlines()[1].split()[:3] == ["one", "thumb", f"{thumb['kappa']:.3f}"]
    assert "-100" in out
    assert err.startswith("two is left out: no labels of 'two' in ")


def test_labels_go_to_label_studio_and_back(capsys, folder):
    out = folder.parent / "studio"
    found = told(capsys, "--export", "label-studio", out, folder)
    assert (out / "label-studio.json") in map(type(out), found["written"])
    assert "exists already" in refused(capsys, "--export", "label-studio", out, folder)
    before = {path.stem: load_recording(path).modules["thumb"].labels for path in folder.iterdir()}
    taken = told(capsys, "--import", out / "label-studio.json", folder, "--author", "bob")
    assert [each["name"] for each in taken["recordings"]] == ["one", "two"]
    for path in sorted(folder.glob("[ot]*.[pm]*")):
        labels = load_recording(path).modules["thumb"].labels
        assert [(x.start, x.end, x.state, x.cause) for x in labels] == [
            (x.start, x.end, x.state, x.cause) for x in before[path.stem]
        ]
        assert load_labels(labels_path(path)).author == "bob"


def test_labels_go_to_csv_and_back(capsys, folder):
    out = folder.parent / "csv"
    told(capsys, "--export", "csv", out, folder)
    assert sorted(path.name for path in out.iterdir()) == ["one.labels.csv", "two.labels.csv"]
    line = refused(capsys, "--import", out / "one.labels.csv", folder)
    assert line.endswith("one.labels.csv holds labels of one recording; 2 recordings given")
    told(capsys, "--import", out / "one.labels.csv", folder / "one.parquet", "--dry-run")
    assert not labels_path(folder / "one.parquet").exists()
    told(capsys, "--import", out, folder)
    inside = load_recording(folder / "two.mcap", labels=False).modules["index"].labels
    labels = load_recording(folder / "two.mcap").modules["index"].labels
    assert [(x.start, x.end, x.state) for x in labels] == [
        (x.start, x.end, x.state) for x in inside
    ]
    by_hand(folder / "two.mcap")
    line = refused(capsys, "--import", out, folder, "--author", "bob")
    assert "one.labels.json (and 1 more): labels of " in line


SUSPECT = Suspect("one", "thumb", "edge", 1.0, 1.5, "stable", "unstable", 0.9, 0.5)


@pytest.fixture
def audited(monkeypatch):
    """An audit that finds one suspect; what it was given."""
    given = []

    def audit(recordings, **_):
        given.append([recording.name for recording in recordings])
        return Audit(len(recordings), 20.0, [SUSPECT])

    monkeypatch.setattr("holdfast.labelling.review.audit.audit", audit)
    return given


def test_an_audit_is_told(capsys, folder, audited):
    found = told(capsys, "--audit", folder)
    assert found["suspects"][0]["recording"] == "one"
    assert found["suspects"][0]["shift"] == 0.5
    code, out, _ = run(capsys, "--audit", folder)
    assert code == 0
    assert out.splitlines()[1].split() == [
        "one", "thumb", "edge", "1.00", "1.50", "stable", "unstable", "0.90", "+0.50",
    ]  # fmt: skip
    assert out.splitlines()[-1] == "1 suspects in 20.0 s of labels of 2 recordings"
    assert audited == [["one", "two"]] * 2


def test_an_audit_is_shown_on_the_page(capsys, folder, audited, monkeypatch):
    shown = []
    monkeypatch.setattr(
        page_mode, "show_label_page", lambda *given: shown.append((given[0], given[-1]))
    )
    assert run(capsys, "--audit", folder, "--page", "--no-browser")[0] == 0
    assert shown == [([folder], [SUSPECT])]


def test_an_audit_needs_labels_to_learn_from(capsys, folder):
    for path in folder.iterdir():
        recording = load_recording(path).with_labels({})
        save_recording(recording, path, force=True)
    code, out, err = run(capsys, "--audit", folder)
    assert (code, out) == (2, "")
    assert err.splitlines()[-1].startswith("holdfast: ")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--auto", "magic", "F"), "unknown rule 'magic'; there are signal, tracking, command"),
        (("--auto", "signal", "F", "--tare", "soon"), "tare: seconds above 0"),
        (("--auto", "signal", "F", "--set", "share"), "--set NAME=VALUE expected, 'share' given"),
        (("--auto", "signal", "F", "--set", "magic=1"), "rule 'signal' has no parameter magic"),
        (("--auto", "signal", "F", "--poses", "p.csv"), "--poses are for the rule tracking; rule"),
        (("--auto", "tracking", "F", "--poses", "gone.csv"), "cannot read gone.csv: No such file"),
        (("--auto", "tracking", "F", "--poses", "a.bag"), "a.bag is no .csv, so taken for a bag: "),
        (
            ("--auto", "tracking", "F", "--poses", "a.bag", "--track", "object=/pose"),
            "cannot read a.bag",
        ),
        (
            ("--auto", "tracking", "F", "--track", "object=/pose"),
            "--track names topics or frames of a bag: give --poses BAG",
        ),
        (("--auto", "signal", "gone"), "gone does not exist; a recording or a folder expected"),
        (("--auto", "signal", "F", "--compare"), "--auto and --compare given; one of them"),
        (("--page", "F"), "--page shows what --audit found: give --audit as well"),
        (("--compare", "F"), "--compare A B: two paths expected, 1 given"),
        (("--compare", "signal", "tracking"), "rules signal and tracking given; one of A and B"),
        (("--compare", "F", "gone"), "gone does not exist; labels, recordings or a rule expected"),
        (("--compare", "F", "command"), "nothing to compare: one: recording 'one' has no marker"),
        (("--export", "yaml", "out", "F"), "--export label-studio or csv expected, 'yaml' given"),
        (("--import", "gone.json", "F"), "gone.json does not exist; labels of Label Studio or CSV"),
        (("gone",), "gone does not exist; a recording or a folder expected"),
        (("F", "--host", "0.0.0.0"), "--host 0.0.0.0 opens the service to the network"),
        (("F", "--port", "99999"), "cannot listen at 127.0.0.1:99999"),
        (("F", "--tare", "soon"), "tare: seconds above 0"),
    ],
)
def test_bad_input_is_one_line(capsys, folder, words, text, monkeypatch):
    monkeypatch.chdir(folder.parent)
    (folder.parent / "p.csv").write_text("time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n")
    code, out, err = run(capsys, *("recordings" if word == "F" else word for word in words))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith(f"holdfast: {text}")


def test_a_folder_without_a_recording(capsys, tmp_path):
    assert refused(capsys, tmp_path).startswith(f"no recording in {tmp_path} (0 other entries)")
    (tmp_path / "a.txt").write_text("a")
    line = refused(capsys, tmp_path / "a.txt")
    assert line.startswith(f"{tmp_path}/a.txt is no recording: .parquet or .mcap expected")


def test_a_label_file_of_another_recording_is_left_alone(capsys, folder):
    path = folder / "one.parquet"
    save_labels(synthetic_recording("other", 5, FINGERS), path, author="rule:signal")
    before = labels_path(path).read_bytes()
    for words in (("--auto", "signal", path), ("--auto", "signal", path, "--force")):
        line = refused(capsys, *words)
        assert "one.labels.json labels another recording ('other'" in line
    assert labels_path(path).read_bytes() == before


def test_a_read_only_label_file(capsys, folder):
    path = folder / "one.parquet"
    told(capsys, "--auto", "signal", path)
    labels_path(path).chmod(0o444)
    line = refused(capsys, "--auto", "signal", path)
    assert line.endswith("one.labels.json cannot be written: it or its folder is read-only")


def test_the_page_is_served_and_keeps_what_was_saved_when_killed(folder):
    words = ["-c", "import sys; from holdfast.cli import main; sys.exit(main())"]
    process = subprocess.Popen(
        [sys.executable, *words, "label", str(folder), "--port", "0", "--no-browser", "--json",
         "--author", "ada"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        url = json.loads(process.stdout.readline())["url"]
        with urlopen(f"{url}api/v1/recordings", timeout=PATIENCE) as answer:
            listed = json.loads(answer.read())
        assert listed["author"] == "ada"
        assert [each["name"] for each in listed["recordings"]] == ["one", "two"]
        save(url, [{"start": 2.0, "end": 3.0, "state": "stable"}])
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
    labels = load_recording(folder / "one.parquet").modules["thumb"].labels
    assert labels == (Label(2.0, 3.0, ContactState.STABLE, author="ada"),)


def save(url, labels):

    body = {"labels": {"thumb": labels}, "note": "", "author": "", "revision": "none"}
    request = Request(f"{url}api/v1/recordings/0/labels", json.dumps(body).encode(), method="PUT")
    deadline = time.monotonic() + PATIENCE
    with urlopen(request, timeout=deadline - time.monotonic()) as answer:
        assert answer.status == 200


def test_poses_of_a_bag(monkeypatch):
    given = []
    monkeypatch.setattr(
        "holdfast.labelling.rules.poses.poses_from_bag",
        lambda *words: given.append(words) or "poses",
    )
    asking = Asking("0.5", Path("run.bag"), ("object = /aruco/pose", "thumb=tip"), ("speed=0.01",))
    assert asking.arguments("tracking") == {"tare": "0.5", "speed": 0.01, "tracking": "poses"}
    assert given == [(Path("run.bag"), "/aruco/pose", {"thumb": "tip"})]
