"""Submissions of other programs are scored by the truth of the recordings alone."""

import csv
import functools
import json
import runpy
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from holdfast import twin_recordings
from holdfast.cli import main
from holdfast.contact import STABLE
from holdfast.io import load_dataset, save_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile
from holdfast_lab.study.benchmark import protocol as protocol_module
from holdfast_lab.study.benchmark.protocol import (
    BenchmarkProtocol,
    BenchmarkSplit,
    digest_of,
    protocol,
    protocols,
)
from holdfast_lab.study.benchmark.scoring import log_odds
from study.example_recordings import SLIPS, recording_with_truth

SCRIPTS = Path(__file__).parents[4] / "benchmarks"
SEEDS = {"tuning": (0, 1, 2), "new-objects": (3, 4, 5), "new-hand-and-objects": (6, 7)}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Recordings of a small benchmark, and its protocol."""
    folder, splits = tmp_path_factory.mktemp("benchmark"), {}
    for name, seeds in SEEDS.items():
        (folder / name).mkdir()
        digests = {}
        for seed in seeds:
            recording = recording_with_truth(f"grasp{seed}", seed)
            save_recording(recording, folder / name / f"grasp{seed}.parquet")
        for recording in load_dataset(folder / name):
            digests[recording.name] = digest_of(recording)
        splits[name] = BenchmarkSplit(
            holds=name, seed=0, repeats=1, scored=name != "tuning", digests=digests
        )
    return folder, BenchmarkProtocol(7, splits)


@pytest.fixture
def folder(made, monkeypatch):
    monkeypatch.setattr(protocol_module, "protocols", lambda: (made[1],))
    return made[0]


dataset = functools.cache(load_dataset)


def rows_of(folder, score, splits=tuple(SEEDS)):
    """Rows of a submission; `score` maps a recording and finger to arrays of scores."""
    for split in splits:
        for recording in dataset(folder / split):
            for finger in recording.modules:
                scores = score(recording, finger)
                for sample, values in enumerate(zip(*scores, strict=True)):
                    yield [f"{split}/{recording.name}", finger, sample, *map(float, values)]


def write_csv(path, rows, names=("recording", "finger", "sample", "stable", "slip")):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows)
    return path


def the_truth(recording, finger):
    module = recording.modules[finger]
    slides = np.zeros(module.n_samples)
    if finger == next(iter(recording.modules)):
        for start, end in SLIPS:
            slides[(module.times >= start) & (module.times < end)] = 1.0
    return (module.label_states == STABLE).astype(float), slides


@pytest.fixture(scope="module")
def truth(made):
    """Rows of a submission without an error."""
    return list(rows_of(made[0], the_truth))


def noisy_truth(recording, finger):
    generator = np.random.default_rng(recording.metadata["seed"])
    stable, slides = the_truth(recording, finger)
    noise = generator.normal(size=(2, len(stable)))
    return 1 / (1 + np.exp(noise[0] - 4 * stable + 2)), 1 / (1 + np.exp(noise[1] - 4 * slides + 2))


def change_of_force(recording, finger):
    """A rule of another program: the force of a held object does not change."""
    readings = recording.modules[finger].readings.astype(float)
    force = np.linalg.norm((readings - readings[:75].mean(axis=0)).sum(axis=1), axis=1)
    change = np.abs(np.diff(force, prepend=force[0]))
    late = np.array([change[max(0, k - 14) : k + 1].max() for k in range(len(change))])
    held = force > 0.3 * np.quantile(force, 0.9)
    return held / (1 + late), held * late / (1 + late)


def scored(capsys, folder, path):
    assert main(["study", "score", str(path), "--benchmark", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    return json.loads(out), err


def figure(document, table, name, **keys):
    (row,) = [
        row
        for row in document["tables"][table]
        if row["figure"] == name and keys.items() <= row.items()
    ]  # fmt: skip
    return row["value"]


def refusal(capsys, folder, path):
    assert main(["study", "score", str(path), "--benchmark", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    return err.removeprefix("holdfast: ").rstrip("\n")


def run_script(monkeypatch, name, *words):
    monkeypatch.setattr(sys, "argv", [name, *words])
    runpy.run_path(str(SCRIPTS / name), run_name="__main__")


def test_the_truth_makes_no_error(capsys, folder, truth, tmp_path):
    document, err = scored(capsys, folder, write_csv(tmp_path / "s.csv", truth))
    assert (document["version"], document["differ"], document["left_out"], err) == (7, [], [], "")
    for split in ("new-objects", "new-hand-and-objects"):
        assert figure(document, "stability", "AUC", on=split) == 1
        assert figure(document, "stability", "accuracy [%]", on=split) == 100
        keys = {"on": split, "threshold": "for 1/min"}
        assert figure(document, "events", "missed at 50 ms [%]", **keys) == 0
        assert figure(document, "slips", "within 30 ms [%]", on=split) == 100
        assert figure(document, "slips", "false alarms per minute held", on=split) == 0
    assert figure(document, "events", "events", on="new-objects", threshold="for 1/min") == 12
    assert figure(document, "slips", "n slips", on="new-objects") == 6


def test_the_scores_of_another_program(capsys, folder, tmp_path):
    path = write_csv(tmp_path / "rule.csv", rows_of(folder, change_of_force))
    document, _ = scored(capsys, folder, path)
    assert document["submission"] == "rule.csv"
    assert 0.7 < figure(document, "stability", "AUC", on="new-objects") < 1
    assert figure(document, "events", "events", on="new-objects", threshold="for 5/min") == 12
    assert main(["study", "score", str(path), "--benchmark", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "Stability by sample\n" in out
    assert "new-hand-and-objects" in out
    assert "Slips of fingers\n" in out


def test_the_script_writes_the_scores_of_a_model(capsys, folder, tmp_path, monkeypatch):
    out = tmp_path / "any.parquet"
    run_script(monkeypatch, "submission.py", str(folder), "builtin:any", str(out))
    document, err = scored(capsys, folder, out)
    assert (document["left_out"], err) == ([], "")
    assert figure(document, "stability", "AUC", on="new-objects") > 0.9
    assert figure(document, "slips", "n slips", on="new-hand-and-objects") == 4


@pytest.mark.skipif(not shutil.which("awk"), reason="there is no awk")
def test_a_program_without_holdfast_reads_and_writes_csv(capsys, folder, tmp_path):
    """`submission.awk`: exported tables in, a submission out."""
    splits = ("tuning", "new-objects")
    for split in splits:
        words = ["export", str(folder / split), str(tmp_path / split), "--format", "csv"]
        assert main(words) == 0
    tables = sorted(path for split in splits for path in (tmp_path / split).glob("*.csv"))
    command = ["awk", "-f", SCRIPTS / "submission.awk", *tables]
    out = tmp_path / "rule.csv"
    out.write_bytes(subprocess.run(command, check=True, capture_output=True).stdout)
    capsys.readouterr()
    document, err = scored(capsys, folder, out)
    assert err == "no scores, and not scored: new-hand-and-objects\n"
    assert list(document["tables"]) == ["stability", "events", "slips"]
    assert figure(document, "stability", "AUC", on="new-objects") > 0.7


def test_parquet_in_any_order_without_slips_and_without_a_split(capsys, folder, tmp_path):
    rows = list(rows_of(folder, noisy_truth, ("tuning", "new-objects")))
    order = np.random.default_rng(0).permutation(len(rows))
    names = ("recording", "finger", "sample", "stable")
    columns = [[rows[k][place] for k in order] for place in range(4)]
    pq.write_table(pa.table(dict(zip(names, columns, strict=True))), tmp_path / "s.parquet")
    document, err = scored(capsys, folder, tmp_path / "s.parquet")
    assert list(document["tables"]) == ["stability", "events"]
    assert document["left_out"] == ["new-hand-and-objects"]
    assert err == "no scores, and not scored: new-hand-and-objects\n"
    whole, _ = scored(capsys, folder, write_csv(tmp_path / "a.csv", rows_of(folder, noisy_truth)))
    assert document["tables"]["events"] == [
        row for row in whole["tables"]["events"] if row["on"] == "new-objects"
    ]


def test_other_recordings_are_named(capsys, folder, made, truth, tmp_path, monkeypatch):
    splits = dict(made[1].splits)
    split = splits["new-objects"]
    digests = {**split.digests, "grasp4": "00"}
    splits["new-objects"] = BenchmarkSplit(holds="", seed=0, repeats=1, digests=digests)
    monkeypatch.setattr(protocol_module, "protocols", lambda: (BenchmarkProtocol(7, splits),))
    path = write_csv(tmp_path / "s.csv", truth)
    document, err = scored(capsys, folder, path)
    assert document["differ"] == ["new-objects/grasp4"]
    assert "1 recordings are not those of the protocol, such as new-objects/grasp4" in err


def changed(rows, place, **values):
    columns = ("recording", "finger", "sample", "stable", "slip")
    rows[place] = list(rows[place])
    for name, value in values.items():
        rows[place][columns.index(name)] = value
    return rows


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r[:1724] + r[1725:],
         "s.csv: 1724 scores given for thumb of tuning/grasp0, 1725 expected: one for each sample"),
        (lambda r: r[1:], "sample 0 of thumb of tuning/grasp0 expected, 1 found; every"),
        (lambda r: [r[0], *r], "sample 1 of thumb of tuning/grasp0 expected, 0 found; every"),
        (lambda r: [row for row in r if row[:2] != ["new-objects/grasp4", "index"]],
         "s.csv: 0 scores given for index of new-objects/grasp4, 1725 expected: one for each"),
        (lambda r: [[row[0].replace("grasp4", "grasp9"), *row[1:]] for row in r],
         "s.csv: unknown recording 'new-objects/grasp9'; new-objects has grasp3, grasp4, grasp5"),
        (lambda r: [[row[0], row[1].replace("index", "ring"), *row[2:]] for row in r],
         "s.csv: unknown finger 'ring' of tuning/grasp0; it has thumb, index"),
        (lambda r: [[row[0].replace("tuning", "train"), *row[1:]] for row in r],
         "s.csv: unknown split 'train'; recordings are SPLIT/NAME, with the splits tuning, new-ob"),
        (lambda r: [row for row in r if "tuning" not in row[0]],
         "s.csv: scores of tuning and of another split expected, new-objects, new-hand-and-"),
        (lambda r: changed(r, 4, stable="nan"),
         "stable is nan in row 5 of 27600; a number from 0 to 1 expected (1 of them are not)"),
        (lambda r: changed(r, 4, slip=1.5), "slip is 1.5 in row 5 of 27600; a number from 0 to 1"),
        (lambda r: changed(r, 4, stable=-0.1), "stable is -0.1 in row 5 of 27600; a number from"),
        (lambda r: changed(r, 4, stable="high"), "'high'"),
        (lambda r: [], "no row given; one for each sample of each finger expected"),
    ],
)  # fmt: skip
def test_bad_submissions(capsys, folder, truth, tmp_path, change, message):
    path = write_csv(tmp_path / "s.csv", change(list(truth)))
    assert message in refusal(capsys, folder, path)


def test_bad_files(capsys, folder, truth, tmp_path):
    rows = list(truth)
    path = write_csv(tmp_path / "s.csv", [row[:3] for row in rows], ("recording", "finger", "n"))
    assert "column 'sample' is missing; recording, finger, sample, stable expected" in refusal(
        capsys, folder, path
    )
    assert "a .csv or .parquet file expected" in refusal(
        capsys, folder, write_csv(tmp_path / "s.x", [])
    )
    (tmp_path / "s.parquet").write_bytes(b"no table")
    assert str(tmp_path / "s.parquet") in refusal(capsys, folder, tmp_path / "s.parquet")
    assert "no such file; a submission" in refusal(capsys, folder, tmp_path / "none.csv")
    path = write_csv(tmp_path / "t.csv", rows)
    assert "`holdfast study data" in refusal(capsys, tmp_path / "nothing", path)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("score",), "score: a .csv or .parquet file expected after it"),
        (("data",), "data: a folder expected after it"),
        (("a", "b"), "a folder, data FOLDER or score FILE expected, 'a b' given"),
        (("score", "a", "b"), "a folder, data FOLDER or score FILE expected, 'score a b' given"),
    ],
)
def test_bad_words(capsys, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["study", *words]) == 2
    assert capsys.readouterr().err == f"holdfast: {message}\n"


def test_log_odds_are_finite():
    assert np.isfinite(log_odds(np.array([0.0, 1e-300, 0.5, 1 - 1e-17, 1.0]))).all()


@pytest.mark.slow
def test_the_recordings_are_simulated_and_compared(capsys, monkeypatch, tmp_path):
    splits = {
        "tuning": BenchmarkSplit(holds="one can", seed=3, repeats=1, scored=False),
        "new-hand-and-objects": BenchmarkSplit(holds="a hand", seed=4, repeats=1, randomized=True),
    }
    monkeypatch.setattr(protocol_module, "protocols", lambda: (BenchmarkProtocol(7, splits),))
    brief = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=1.5)
    monkeypatch.setattr(simulation, "profile", lambda name: brief)
    known = twin_recordings.plan_grasps
    monkeypatch.setattr(
        twin_recordings, "plan_grasps", lambda _, *rest, **more: known("can", *rest, **more)
    )
    words = ["study", "data", str(tmp_path / "b"), "--jobs", "1", "--json"]
    assert main(words) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    names = {"can-case1-1", "can-case2-1"}
    assert names <= set(document["tuning"]["differ"])
    assert list(document["new-hand-and-objects"]["recordings"]) == ["hand0000"]
    assert "new-hand-and-objects: 1 of 1 recordings differ from the protocol" in err
    for name in splits:
        digests = document[name]["recordings"]
        splits[name] = msgspec.structs.replace(splits[name], digests=digests)
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["tuning"] == {"recordings": splits["tuning"].digests, "differ": []}
    assert "differ" not in err


def test_the_protocol_has_digests_of_all_splits():
    splits = protocol().splits
    assert list(splits) == [
        "train", "tuning", "new-objects", "new-hand-and-objects", "slips", "knocks", "aged-skins",
    ]  # fmt: skip
    assert [name for name, split in splits.items() if split.scored] == list(splits)[2:]
    assert len({split.seed for split in splits.values()}) == len(splits)
    digests = [digest for split in splits.values() for digest in split.digests.values()]
    assert all(len(split.digests) >= 12 for split in splits.values())
    assert len(set(digests)) == len(digests)


def test_the_digests_of_version_1_stay():
    first, newest = protocols()
    assert (first.version, newest.version) == (1, 2)
    assert newest is protocol()
    assert set(first.splits) < set(newest.splits)
    old = {name: split.digests for name, split in first.splits.items()}
    # Never renew this digest: recordings of version 1 could no longer be checked.
    assert sha256(json.dumps(old, sort_keys=True).encode()).hexdigest() == (
        "e7389ddc5ebe01c045724bc6dcb8be6a94ca3d99516c10a68c7abd4f936ef1b0"
    )


def test_a_folder_has_the_version_of_its_recordings(made, monkeypatch, tmp_path):
    folder, old = made
    other = {name: msgspec.structs.replace(s, digests={}) for name, s in old.splits.items()}
    newest = BenchmarkProtocol(8, other)
    monkeypatch.setattr(protocol_module, "protocols", lambda: (old, newest))
    assert protocol(folder).version == 7
    assert protocol(tmp_path).version == protocol().version == 8
    monkeypatch.setattr(protocol_module, "protocols", lambda: (newest, newest))
    assert protocol(folder).version == 8
