import pytest

from holdfast.cli.teach import guide as module
from holdfast.cli.teach.guide import Guide, confirm_safety
from holdfast.cli.teach.screen import TeachScreen
from holdfast.cli.terminal.control import StopRequest
from holdfast.detection import Model
from holdfast.devices.sources.replay import ReplaySource
from holdfast.errors import SourceError, TrainingError
from holdfast.io import load_recording, save_recording
from holdfast.live.teaching.folder import TeachingFolder
from holdfast.live.teaching.protocol import Stage
from holdfast.live.teaching.steps import Check, Step
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow

OPEN = Step("open", "OPEN", "How.", Check.HEALTH, 0.5, in_view=False)
HOLD = Step("hold", "HOLD", "How.", Check.FELT, 3.0, in_view=False)
TAP = Step("tap", "TAP", "How.", Check.FELT, 3.0, n_actions=1, in_view=False)


class Keys:
    """Keys by what the protocol does: `choose` returns the lines since the last call."""

    interactive = stop_pressed = ended = False

    def __init__(self, choose=lambda protocol: []):
        self.choose = choose
        self.guide = None

    def poll(self):
        return self.choose(self.guide.protocol)


def goes_on(protocol):
    return ["next"] if protocol.stage is Stage.DECIDE else []


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    path = tmp_path_factory.mktemp("source") / "hand.mcap"
    save_recording(synthetic_recording("hand", 1), path)
    return path


@pytest.fixture
def lead(grasp, tmp_path):
    """Run the protocol on a hand that grasps again and again, and return the folder."""

    def run(choose, *steps, resume=False, loop=True, **options):
        folder = TeachingFolder(tmp_path / "grasps", resume=resume)
        with ReplaySource(grasp, speed=0, loop=loop) as source:
            keys = Keys(choose)
            model = Model.load("builtin:any")
            keys.guide = Guide(source, model, folder, steps, **options)
            keys.guide.run(StopRequest(), keys, TeachScreen())
        return folder

    return run


def test_each_grasp_is_recorded_with_its_markers_and_labels(lead):
    noted = iter(["the robot pulls"])

    def choose(protocol):
        return goes_on(protocol) or (list(noted) if protocol.stage is Stage.ACT else [])

    folder = lead(choose, OPEN, HOLD)
    assert [(x.name, x.recording, x.kept) for x in folder.results] == [
        ("open", "001-open", True), ("hold", "002-hold", True)
    ]  # fmt: skip
    opened = load_recording(folder.path / "001-open.mcap")
    assert [text for _, text in opened.markers if "starts again" not in text] == [
        "teach: open begins", "the robot pulls", "teach: open ends"
    ]  # fmt: skip
    held = load_recording(folder.path / "002-hold.mcap")
    marked = [marker for marker in held.markers if "starts again" not in marker[1]]
    assert [text for _, text in marked] == ["teach: hold begins", "teach: hold ends"]
    assert held.metadata["teach_step"] == "hold"
    assert held.complete
    assert all(module.labels for module in held.modules.values())
    begin = marked[0][0] - held.start
    assert begin > 1.5  # the open hand is in it


@pytest.mark.parametrize("number", [1, 2, 3])
def test_what_was_stopped_goes_on_at_its_step(lead, number):
    steps = (OPEN, HOLD, TAP)
    broken = steps[number - 1]

    def stops(protocol):
        inside = protocol.step is broken and protocol.stage is Stage.ACT
        return ["quit"] if inside else goes_on(protocol)

    kept = rf"{number - 1} of 3 grasps are in .*/grasps: .* --resume$"
    with pytest.raises(TrainingError, match=kept):
        lead(stops, *steps)
    folder = lead(goes_on, *steps, resume=True)
    assert [x.name for x in folder.kept] == ["open", "hold", "tap"]
    # Nothing is lost: what was recorded of the broken step is aside.
    name = f"00{number}-{broken.name}"
    assert [path.stem for path in folder.aside.glob("*.mcap")] == [name]
    assert load_recording(folder.aside / f"{name}.mcap").complete
    assert folder.results[-1].recording == "004-tap"


def test_a_grasp_is_repeated_and_a_step_skipped(lead):
    keys = iter(["repeat", "next", "skip"])

    def choose(protocol):
        is_asked = protocol.stage is Stage.DECIDE
        return [next(keys)] if is_asked else []

    folder = lead(choose, OPEN, HOLD)
    assert [(x.name, x.kept) for x in folder.results] == [
        ("open", False), ("open", True), ("hold", False), ("hold", False)
    ]  # fmt: skip
    assert [path.name for path in folder.path.glob("*.mcap")] == ["002-open.mcap"]


def test_a_robot_whose_lines_end_stops_the_protocol(lead, monkeypatch):
    monkeypatch.setattr(Keys, "ended", True)
    with pytest.raises(TrainingError, match="1 of 2 grasps"):
        lead(lambda _: [], OPEN, HOLD)
    monkeypatch.undo()
    assert [x.name for x in lead(goes_on, OPEN, HOLD, resume=True).kept] == ["open", "hold"]


def test_without_a_person_a_grasp_that_fails_is_repeated_once(lead):
    still = HOLD._replace(check=Check.FELT, name="tap", n_actions=99)
    folder = lead(lambda _: [], still, unattended=True)
    assert [x.kept for x in folder.results] == [False, True]
    assert " of 99 felt" in folder.results[0].text


def test_a_source_that_ends_in_a_step_is_an_error(lead, grasp):
    with pytest.raises(SourceError, match=f"{grasp}.*0 of 2 grasps are in .* --resume$"):
        lead(goes_on, OPEN, HOLD, loop=False)


def test_keys_throw_a_slide_away(lead, monkeypatch, capsys):
    slide = module.Slide(3.0, 3.5, {"thumb": None})
    left = [slide] * 3
    monkeypatch.setattr(module, "label_grasp", lambda path, step: (left, ""))
    monkeypatch.setattr(module, "write_pictures", lambda folder, names: None)

    def throw(path, number):
        if number > 3:
            raise ValueError(f"slide {number} given; this grasp has 3")
        return left[1:]

    monkeypatch.setattr(module, "throw_away", throw)
    keys = iter(["throw away 7", "throw away 1", "next"])
    step = HOLD._replace(name="pull", check=Check.SLID)
    folder = lead(lambda p: [next(keys)] if p.stage is Stage.DECIDE else [], step)
    assert [x.n_slides for x in folder.kept] == [2]
    lines = capsys.readouterr().err.splitlines()
    assert "slide 7 given; this grasp has 3" in lines
    assert sum("thumb" in line for line in lines) >= 3


def test_a_camera_films_the_steps_that_it_sees(lead, monkeypatch):
    filmed = []

    class Camera:
        def __init__(self, camera, path):
            filmed.append((camera, path.name))

        def start(self, recorder, say):
            filmed.append(recorder.path.name)

        def close(self):
            filmed.append("closed")

    monkeypatch.setattr(module, "CameraRecorder", Camera)
    monkeypatch.setattr(module, "label_grasp", lambda path, step: (None, f"{path.stem}: no video"))
    seen = HOLD._replace(in_view=True)
    folder = lead(goes_on, seen, TAP, camera="0")
    assert filmed[-3:] == [("0", "001-hold.mp4"), "001-hold.mcap", "closed"]
    assert folder.kept[0].text.endswith("movements felt")


@pytest.mark.parametrize(
    ("answers", "ended", "confirmed"),
    [(["next"], False, True), (["quit"], False, False), ([], True, False)],
)
def test_safety_is_confirmed_first(answers, ended, confirmed, capsys):
    keys = Keys()
    keys.poll, keys.ended = lambda: answers, ended
    assert confirm_safety("No camera.", StopRequest(), keys, TeachScreen()) is confirmed
    lines = capsys.readouterr().err.splitlines()
    assert "No camera." in lines
    assert all(len(line) <= 80 for line in lines)
