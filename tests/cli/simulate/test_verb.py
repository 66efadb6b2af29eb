import functools
import json
import signal
import subprocess
import sys
import time

import msgspec
import pytest

from command_line import Verb
from holdfast.cli import main
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


def test_text_has_the_number_of_recordings(capsys, out):
    code, printed, _ = run(capsys, out, *ONE)
    assert (code, printed) == (0, f"1 recordings in {out}, 0 of them of failed grasps\n")


def test_existing_recordings_are_kept(capsys, out):
    run(capsys, out, *ONE)
    (path,) = out.iterdir()
    before = (path.stat().st_mtime_ns, path.stat().st_ino)
    code, printed, err = run(capsys, out, *ONE[:-4], "--repeats", 2, "--jobs", 1, "--json")
    assert code == 0
    assert json.loads(printed)["recordings"] == ["flask-case1-2"]
    assert "1 of 2 recordings exist already" in err
    assert (path.stat().st_mtime_ns, path.stat().st_ino) == before
    assert json.loads(run(capsys, out, *ONE, "--json")[1])["recordings"] == []


def test_troubles_of_the_skins(capsys, out):
    run(capsys, out, *ONE, "--faults", "zero-share=0.1, field=200")
    recording = load_recording(out / "flask-case1-1.parquet")
    assert recording.metadata["magnetic_faults"] == {
        "field": 200.0, "turn_time": 8.0, "zero_share": 0.1, "drift": 0.0, "cross_talk": 0.0,
        "invented_months": 0.0,
    }  # fmt: skip
    zeros = (recording.modules["thumb"].readings == 0).all(axis=2).any(axis=1)
    assert 0.05 < zeros.mean() < 0.15
    code, _, err = run(capsys, out, *ONE, "--faults", "zero-share=0.1,field=200")
    assert (code, "1 of 1 recordings exist already" in err) == (0, True)


def test_the_number_of_processes_changes_nothing(capsys, out, tmp_path, monkeypatch):
    monkeypatch.undo()  # other processes know of no patch
    other = tmp_path / "other"
    words = ("--objects", "flask", "--cases", 1, "--repeats", 2)
    assert run(capsys, out, *words, "--jobs", 1)[0] == 0
    assert run(capsys, other, *words, "--jobs", 2)[0] == 0
    assert names(out) == names(other)
    for name in names(out):
        assert (out / name).read_bytes() == (other / name).read_bytes()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--seed", "1"), "seed 0"),
        (("--profile", "gentle"), "profile reference"),
        (("--server",), "server False"),
        (("--faults", "field=9"), "magnetic_faults {'field': 9.0, "),
    ],
)
def test_recordings_with_other_settings_are_refused(capsys, out, words, text):
    run(capsys, out, *ONE)
    line = refusal(capsys, out, *ONE, *words)
    assert f"{out}/flask-case1-1.parquet has profile" in line
    assert text in line
    assert "--force" in line


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


def test_force_simulates_all_again(capsys, out):
    run(capsys, out, *ONE)
    code, printed, _ = run(capsys, out, *ONE, "--seed", 1, "--force", "--json")
    assert (code, json.loads(printed)["recordings"]) == (0, ["flask-case1-1"])
    assert load_recording(out / "flask-case1-1.parquet").metadata["seed"] == 1


class TestFailures:
    @pytest.fixture
    def weak(self, monkeypatch):
        """Make the hands too weak to hold; return the list of simulated grasps."""
        tried = []

        def simulate(grasp, *_):
            tried.append(grasp.attempt)
            return whole(grasp)

        whole = simulation.simulate
        monkeypatch.setattr(simulation, "profile", lambda name: WEAK)
        monkeypatch.setattr(simulation, "simulate", simulate)
        return tried

    FAILED = tuple(f"flask-case1-1-failed{k}.parquet" for k in (1, 2, 3, 4))

    def test_are_kept_and_repeated_a_limited_number_of_times(self, capsys, out, weak):
        code, printed, _ = run(capsys, out, *ONE, "--json")
        assert code == 0
        assert weak == list(range(GRASP_ATTEMPTS))
        assert names(out) == list(self.FAILED)
        assert json.loads(printed)["failed"] == [
            name.removesuffix(".parquet") for name in names(out)
        ]
        assert {r.metadata["case"] for r in load_dataset(out)} == {"failed"}

    def test_are_not_simulated_again(self, capsys, out, weak):
        run(capsys, out, *ONE)
        (out / self.FAILED[2]).unlink()
        (out / self.FAILED[3]).unlink()
        weak.clear()
        run(capsys, out, *ONE)
        assert weak == [2, 3]
        assert names(out) == list(self.FAILED)
        weak.clear()
        run(capsys, out, *ONE)
        assert weak == []

    def test_of_another_seed_are_not_mixed_in(self, capsys, out, weak, monkeypatch):
        run(capsys, out, *ONE)
        (out / self.FAILED[3]).unlink()
        assert "parquet has profile" in refusal(capsys, out, *ONE, "--seed", 1)

    def test_older_ones_are_removed_by_force(self, capsys, out, weak, monkeypatch):
        run(capsys, out, *ONE)
        monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
        code, _, err = run(capsys, out, *ONE, "--seed", 1, "--force")
        assert (code, err) == (0, "")
        assert names(out) == ["flask-case1-1.parquet"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--objects", "cup"), "no object 'cup'; there are ball, box, can"),
        (("--objects", "can,"), "no object ''; there are"),
        (("--profile", "rough"), "unknown profile 'rough'; there are coupled, finger-gentle"),
        (("--cases", "3"), "--cases 1, 2 or 1,2 expected, '3' given"),
        (("--cases", ""), "--cases 1, 2 or 1,2 expected, '' given"),
        (("--repeats", "0"), "repeats of at least 1"),
        (("--seed", "-1"), "a seed of at least 0 expected; 5 and -1 given"),
        (("--seed", "one"), "Invalid value for '--seed'"),
        (("--film", "film.avi"), "film.avi"),
        (
            ("--faults", "field=3,rust=1"),
            "--faults with each of field, turn-time, zero-share, drift, cross-talk, "
            "invented-months at most once expected, 'rust=1' given",
        ),
        (("--faults", "field=3,field=4"), "at most once expected, 'field=4' given"),
        (("--faults", "zero-share=few"), "--faults zero-share: a number expected, 'few' given"),
        (("--faults", "drift"), "--faults drift: a number expected, '' given"),
        (("--faults", "drift=-1"), "drift: at least 0 expected, -1.0 given"),
    ],
)
def test_bad_input_is_one_line_and_makes_no_folder(capsys, out, words, text):
    assert text in refusal(capsys, out, *words)
    assert not out.exists()


def test_a_file_for_a_folder(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    assert "file" in refusal(capsys, tmp_path / "file", *ONE)


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
    assert len(load_dataset(out)) == 4


MUG = """mug = {shape = "cylinder", size = [0.036, 0.05, 0.003], mass = 0.2, friction = [0.7, 0.55],
 texture = [10e-6, 1.5e-3], finger_height = 0.024, yaw = 0.0}""".replace("\n", "")


def test_an_own_object(tmp_path):
    from holdfast.twin_recordings import plan_grasps

    table = tmp_path / "mine.toml"
    table.write_text(MUG)
    (grasp,) = plan_grasps("", "1", 1, "reference", 0, table=table)
    assert (grasp.name, grasp.item.mass) == ("mug-case1-1", 0.2)


def test_an_object_whose_name_is_a_path_stays_in_the_folder(capsys, tmp_path):
    table = tmp_path / "mine.toml"
    table.write_text(MUG.replace("mug", '"../../mug"', 1))
    out = tmp_path / "a" / "b"
    words = (out, "--table", table, "--cases", 1, "--repeats", 1, "--jobs", 1)
    assert run(capsys, *words)[0] == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "mine.toml"]
    assert [path.name for path in out.parent.iterdir()] == ["b"]
    assert load_dataset(out)[0].name == "../../mug-case1-1"
    assert run(capsys, *words)[2] == "1 of 1 recordings exist already\n"


def test_a_table_that_lacks_the_object(tmp_path, capsys):
    table = tmp_path / "mine.toml"
    table.write_text(MUG)
    words = ["simulate", str(tmp_path / "out"), "--table", str(table), "--objects", "can"]
    assert main(words) == 2
    assert capsys.readouterr().err == "holdfast: no object 'can'; there are mug\n"


class TestRandomizedHands:
    def test_are_simulated_and_kept(self, capsys, out):
        words = (out, "--randomize", "--repeats", 2, "--seed", 4, "--jobs", 1, "--json")
        code, printed, _ = run(capsys, *words)
        assert code == 0
        assert json.loads(printed) == {
            "out": str(out),
            "recordings": ["hand0000", "hand0001"],
            "failed": [],
            "profile": "randomized",
        }
        assert {r.metadata["profile"] for r in load_dataset(out)} == {"randomized"}
        code, printed, err = run(capsys, *words)
        assert json.loads(printed)["recordings"] == []
        assert "2 of 2 recordings exist already" in err

    def test_several_grasps_of_each(self, capsys, out):
        words = (out, "--randomize", "--repeats", 1, "--grasps", 2, "--jobs", 1, "--json")
        code, printed, _ = run(capsys, *words)
        names = ["hand0000-grasp01", "hand0000-grasp02"]
        assert (code, json.loads(printed)["recordings"]) == (0, names)

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            (("--randomize", "--grasps", 0), "--grasps of at least 1 expected, 0 given"),
            (
                ("--grasps", 2),
                "--grasps is for the hands of --randomize, 2 given; --repeats repeats grasps",
            ),
            (("--measured", "scan"), "--measured is for the hands of --randomize"),
            (
                ("--randomize", "--measured", "scan,glue"),
                "--measured: unknown mechanism 'glue'; there are scan, filter, noise, vibration, "
                "colour, steps, updates, stamps, carry, person, "
                "all",
            ),
        ],
    )
    def test_their_grasps_are_checked(self, capsys, out, words, message):
        assert refusal(capsys, out, *words) == message

    def test_of_another_seed_are_refused(self, capsys, out):
        run(capsys, out, "--randomize", "--repeats", 1, "--jobs", 1)
        told = refusal(capsys, out, "--randomize", "--repeats", 1, "--seed", 9)
        assert told == (
            f"{out / 'hand0000.parquet'} has profile randomized, seed 0; profile randomized, seed "
            "9 given: choose another folder, or overwrite it with --force"
        )

    def test_with_and_without_measured_mechanisms_are_different_recordings(self, capsys, out):
        words = ("--randomize", "--repeats", 1, "--jobs", 1)
        run(capsys, out, *words, "--measured", "noise,scan")
        (recording,) = load_dataset(out)
        assert recording.metadata["measured"] == ["scan", "noise"]
        told = refusal(capsys, out, *words)
        assert told.startswith(
            f"{out / 'hand0000.parquet'} has profile randomized, seed 0, measured ['scan', 'noise']"
            "; profile randomized, seed 0 given"
        )
        code, _, err = run(capsys, out, *words, "--measured", "scan, noise")
        assert (code, "1 of 1 recordings exist already" in err) == (0, True)

    def test_their_number_is_checked(self, capsys, out):
        told = refusal(capsys, out, "--randomize", "--repeats", 0)
        assert told == ("repeats of at least 1 and a seed of at least 0 expected; 0 and 0 given")
