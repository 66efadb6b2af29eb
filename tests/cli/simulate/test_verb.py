import functools
import json
import signal
import subprocess
import sys
import time

import msgspec
import pytest

from command_line import Verb
from holdfast.io import load_dataset, load_recording
from holdfast.twin import simulation
from holdfast.twin.profile import GRASP_ATTEMPTS, profile

SHORT = msgspec.structs.replace(profile("reference"), idle=(0.2, 0.3), hold=1.0)
WEAK = msgspec.structs.replace(SHORT, grip=0.2)
ONE = ("--objects", "flask", "--cases", "1", "--repeats", "1", "--jobs", "1")


WHOLE = simulation.simulate


@functools.cache
def simulated(grasp, grip):
    """A grasp with the profile that is patched, which differs in its grip alone."""
    return WHOLE(grasp)


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Short grasps, each of them simulated once for all tests."""
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    monkeypatch.setattr(
        simulation, "simulate", lambda grasp: simulated(grasp, simulation.profile("").grip)
    )


@pytest.fixture
def out(tmp_path):
    return tmp_path / "twin"


VERB = Verb("simulate")
run, refusal = VERB.run, VERB.refusal


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_json_lists_the_recordings(capsys, out):
    code, printed, _ = run(
        capsys, out, "--objects", "flask,ball", "--repeats", 1, "--seed", 3, "--jobs", 1, "--json"
    )
    assert code == 0
    document = json.loads(printed)
    made = [f"{thing}-case{case}-1" for thing in ("flask", "ball") for case in (1, 2)]
    assert document == {"out": str(out), "recordings": made, "failed": [], "profile": "reference"}
    assert names(out) == sorted(f"{name}.parquet" for name in made)
    for recording in load_dataset(out):
        assert recording.metadata["seed"] == 3
        assert recording.truth is not None


def test_recordings_with_other_settings_are_replaced_by_force_only(capsys, out):
    run(capsys, out, *ONE)
    for words, text in (
        (("--seed", "1"), "seed 0"),
        (("--profile", "gentle"), "profile reference"),
        (("--server",), "server False"),
        (("--faults", "field=9"), "'field': 9.0"),
    ):
        line = refusal(capsys, out, *ONE, *words)
        assert "flask-case1-1.parquet" in line and text in line and "--force" in line
    document = VERB.document(capsys, out, *ONE, "--seed", 1, "--force")
    assert document["recordings"] == ["flask-case1-1"]
    assert load_recording(out / "flask-case1-1.parquet").metadata["seed"] == 1


def test_a_video_is_written_beside_each_recording_once(capsys, out, monkeypatch):
    pytest.importorskip("cv2")
    from holdfast.twin import webcam

    filmed = []

    def film(recording, path, camera):
        filmed.append((recording.name, camera.fps))
        path.write_bytes(b"film")

    monkeypatch.setattr(webcam, "film_stickers", film)
    assert run(capsys, out, *ONE, "--video")[0] == 0
    assert names(out) == ["flask-case1-1.mp4", "flask-case1-1.parquet"]
    assert run(capsys, out, *ONE, "--video")[0] == 0
    assert filmed == [("flask-case1-1", 60.0)]
    assert run(capsys, out, *ONE, "--video", "--fps", 30, "--force")[0] == 0
    assert filmed[1:] == [("flask-case1-1", 30.0)]


def test_failed_grasps_are_kept_and_repeated_a_limited_number_of_times(capsys, out, monkeypatch):
    tried = []

    def simulate(grasp, *_):
        tried.append(grasp.attempt)
        return whole(grasp)

    whole = simulation.simulate
    monkeypatch.setattr(simulation, "profile", lambda name: WEAK)
    monkeypatch.setattr(simulation, "simulate", simulate)
    failed = [f"flask-case1-1-failed{k}" for k in (1, 2, 3, 4)]
    assert VERB.document(capsys, out, *ONE)["failed"] == failed
    assert tried == list(range(GRASP_ATTEMPTS))
    assert names(out) == [f"{name}.parquet" for name in failed]
    assert {r.metadata["case"] for r in load_dataset(out)} == {"failed"}
    for name in failed[2:]:
        (out / f"{name}.parquet").unlink()
    tried.clear()
    assert "failed1.parquet" in refusal(capsys, out, *ONE, "--seed", 1)
    for _ in range(2):
        run(capsys, out, *ONE)
        assert tried == [2, 3]  # and then none
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    assert run(capsys, out, *ONE, "--seed", 1, "--force")[0] == 0
    assert names(out) == ["flask-case1-1.parquet"]


def test_a_killed_run_can_be_continued(capsys, out):
    words = ["--objects", "flask", "--cases", "1", "--repeats", "4"]
    program = f"""if True:
        import sys, msgspec
        from holdfast.cli import main
        from holdfast.twin import simulation
        whole = simulation.profile("reference")
        brief = msgspec.structs.replace(whole, idle={SHORT.idle}, hold={SHORT.hold})
        simulation.profile = lambda name: brief
        sys.exit(main(sys.argv[1:]))
    """
    child = subprocess.Popen(
        [sys.executable, "-c", program, "simulate", str(out), *words, "--jobs", "1"],
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 60
    while not (out.is_dir() and list(out.glob("[!.]*.parquet"))):
        assert time.monotonic() < deadline
        assert child.poll() is None
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.wait()
    finished = {path: path.stat().st_mtime_ns for path in out.glob("[!.]*.parquet")}
    assert 0 < len(finished) < 4
    for path in finished:
        assert load_recording(path).complete
    code, printed, _ = run(capsys, out, *words, "--jobs", 1, "--json")
    assert code == 0
    assert len(json.loads(printed)["recordings"]) == 4 - len(finished)
    assert all(path.stat().st_mtime_ns == time for path, time in finished.items())
    other = out.with_name("other")
    assert run(capsys, other, *words, "--jobs", 1)[0] == 0
    for name in names(other):  # also those of the other process
        assert (out / name).read_bytes() == (other / name).read_bytes()


def test_randomized_hands_are_simulated_and_kept(capsys, out):
    words = (out, "--randomize", "--repeats", 1, "--grasps", 2, "--jobs", 1)
    measured = (*words, "--measured", "noise,scan")
    made = ["hand0000-grasp01", "hand0000-grasp02"]
    assert VERB.document(capsys, *measured) == {
        "out": str(out), "recordings": made, "failed": [], "profile": "randomized"
    }  # fmt: skip
    for recording in load_dataset(out):
        assert recording.metadata["profile"] == "randomized"
        assert recording.metadata["measured"] == ["scan", "noise"]
    assert VERB.document(capsys, *words, "--measured", "scan, noise")["recordings"] == []
    for other in (words, (*measured, "--seed", 9)):
        assert "hand0000-grasp01.parquet" in refusal(capsys, *other)
