"""`holdfast label`: the page, exchange by CSV, poses of a bag, and stickers."""

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

from holdfast.cli.label.inputs import RuleOptions
from holdfast.contact import ContactState
from holdfast.io import labels_path, load_recording, save_recording
from holdfast.recordings import Label

from .helpers import VERB, refusal, run_json, save_manual_labels


def test_labels_go_to_csv_and_back(capsys, folder):
    out = folder.parent / "csv"
    run_json(capsys, "export", "csv", out, folder)
    assert sorted(path.name for path in out.iterdir()) == ["one.labels.csv", "two.labels.csv"]
    run_json(capsys, "import", out / "one.labels.csv", folder / "one.parquet", "--dry-run")
    assert not labels_path(folder / "one.parquet").exists()
    run_json(capsys, "import", out, folder)
    inside = load_recording(folder / "two.mcap", labels=False).modules["index"].labels
    labels = load_recording(folder / "two.mcap").modules["index"].labels
    assert [(x.start, x.end, x.state) for x in labels] == [
        (x.start, x.end, x.state) for x in inside
    ]
    save_manual_labels(folder / "two.mcap")
    assert "(and 1 more)" in refusal(capsys, "import", out, folder, "--author", "bob")


def test_a_recording_whose_name_is_a_path_is_exported_into_the_folder(capsys, folder):
    path = folder / "one.parquet"
    for name in ("../../up", str(folder.parent / "abs")):
        save_recording(replace(load_recording(path), name=name), path, force=True)
        before = sorted(folder.parent.iterdir())
        run_json(capsys, "export", "csv", folder / "out", path)
        run_json(capsys, "import", folder / "out", path, "--dry-run")
        assert sorted(folder.parent.iterdir()) == before
    assert len(list((folder / "out").iterdir())) == 2


def test_poses_of_a_bag(monkeypatch):
    given = []
    monkeypatch.setattr(
        "holdfast.labelling.rules.poses.poses_from_bag",
        lambda *words: given.append(words) or "poses",
    )
    options = RuleOptions(
        "0.5",
        Path("run.bag"),
        tracks=["object = /aruco/pose", "thumb=tip"],
        parameters=["speed=0.01"],
    )
    assert options.arguments("tracking") == {"tare": "0.5", "speed": 0.01, "tracking": "poses"}
    assert given == [(Path("run.bag"), "/aruco/pose", {"thumb": "tip"})]


@pytest.mark.parametrize("name", ["audit", "compare"])
def test_a_folder_may_have_the_name_of_a_command_that_was_removed(
    capsys, tmp_path, monkeypatch, name
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    assert refusal(capsys, name).startswith(f"{name} is empty")


def test_a_sheet_of_markers(capsys, tmp_path):
    pytest.importorskip("cv2")
    sheet = tmp_path / "sheet.pdf"
    assert run_json(capsys, "markers", sheet) == {"sheet": str(sheet)}
    assert sheet.read_bytes().startswith(b"%PDF-1.4")
    assert str(sheet) in VERB.run(capsys, "markers", sheet, "--force")[1]


TIMEOUT = 60.0


def test_the_page_is_served_and_keeps_what_was_saved_when_killed(folder):
    words = ["-c", "import sys; from holdfast.cli import main; sys.exit(main())"]
    process = subprocess.Popen(
        [sys.executable, *words, "label", str(folder), "--port", "0", "--no-browser", "--json",
         "--author", "ada"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        url = json.loads(process.stdout.readline())["url"]
        with urlopen(f"{url}api/v1/recordings", timeout=TIMEOUT) as answer:
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
    deadline = time.monotonic() + TIMEOUT
    with urlopen(request, timeout=deadline - time.monotonic()) as answer:
        assert answer.status == 200
