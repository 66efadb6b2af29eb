import json
from dataclasses import replace

import pytest

from holdfast.io import labels_path, load_labels, load_recording, save_recording

from .helpers import refusal, run, run_json, save_manual_labels


def test_a_rule_labels_a_folder(capsys, folder):
    found = run_json(capsys, "auto", "signal", folder)
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


def test_recordings_that_begin_in_contact_have_their_first_sample_as_tare(capsys, folder):
    path = folder / "two.mcap"
    held = replace(load_recording(path), metadata={"starts_loaded": True})
    save_recording(held, path, force=True)
    words = ("auto", "signal", folder, "--dry-run")
    code, out, err = run(capsys, *words, "--json")
    assert (code, "1 of 2 recordings begin in contact" in err) == (0, True)
    (one, two) = json.loads(out)["recordings"]
    assert (one["starts_loaded"], two["starts_loaded"]) == ("", "metadata: starts_loaded")
    (_, first) = run_json(capsys, *words, "--tare", "first")["recordings"]
    assert first["labels"] == two["labels"]
    assert "--tare first fits them" in run(capsys, *words, "--tare", "0.5")[2]


def test_a_dry_run_writes_nothing(capsys, folder):
    before = sorted(folder.iterdir())
    found = run_json(capsys, "auto", "signal", folder, "--dry-run")
    assert found["written"] is False
    assert found["recordings"][0]["labels"]["thumb"]
    assert sorted(folder.iterdir()) == before


def test_a_rule_may_label_again_but_not_over_a_person(capsys, folder):
    path = folder / "one.parquet"
    run_json(capsys, "auto", "signal", path)
    run_json(capsys, "auto", "signal", path, "--author", "rule:mine")
    assert load_labels(labels_path(path)).author == "rule:mine"
    save_manual_labels(path)
    before = labels_path(path).read_bytes()
    line = refusal(capsys, "auto", "signal", folder)
    assert f"{labels_path(path)}: labels of ada" in line and "--force" in line
    assert labels_path(path).read_bytes() == before
    assert not labels_path(folder / "two.mcap").exists()
    run_json(capsys, "auto", "signal", path, "--dry-run")
    assert labels_path(path).read_bytes() == before
    run_json(capsys, "auto", "signal", folder, "--force")
    file = load_labels(labels_path(path))
    assert (file.author, file.notes) == ("rule:signal", "careful")


def test_recordings_that_a_rule_cannot_label_do_not_stop_the_others(capsys, folder):
    (folder / "cut.parquet").write_bytes((folder / "one.parquet").read_bytes()[:500])
    code, out, err = run(capsys, "auto", "signal", folder, "--json")
    assert code == 2
    first, *others = json.loads(out)["recordings"]
    assert "cut.parquet" in first["error"]
    assert err.splitlines()[-1] == f"holdfast: {first['error']}"
    assert [labels_path(each["path"]).exists() for each in others] == [True, True]


def test_parameters_of_a_rule(capsys, folder):
    path = folder / "one.parquet"
    usual = run_json(capsys, "auto", "signal", path, "--dry-run")
    blunt = run_json(capsys, "auto", "signal", path, "--dry-run", "--set", "share=0.9")
    assert blunt["recordings"][0]["seconds"] != usual["recordings"][0]["seconds"]
    poses = folder.parent / "poses.csv"
    rows = "".join(f"{k / 100},0,0,0,1,0,0,{1e-9 * (k % 2)}\n" for k in range(1200))
    poses.write_text("time,x,y,z,qw,qx,qy,qz\n" + rows)
    found = run_json(capsys, "auto", "tracking", path, "--poses", poses)
    assert found["recordings"][0]["seconds"]["stable"] > 1
