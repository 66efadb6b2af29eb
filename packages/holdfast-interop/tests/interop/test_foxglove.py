"""Files for Foxglove, read back by the mcap reader."""

import json
import re
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mcap.reader import make_reader

from holdfast.detector import detect
from holdfast.errors import OutputError
from holdfast.model import Model
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording
from holdfast_interop.foxglove.exporter import LAYOUT_FILE, export, layout
from holdfast_interop.foxglove.schemas import SCHEMAS
from holdfast_interop.scene.taxel_arrows import LONGEST_ARROW, orientations


class File:
    """Content of an exported file."""

    def __init__(self, path):
        with path.open("rb") as stream:
            reader = make_reader(stream)
            self.summary = reader.get_summary()
            self.metadata = next(iter(reader.iter_metadata())).metadata
            self.messages = [
                (channel.topic, schema.name, message.log_time, json.loads(message.data))
                for schema, channel, message in reader.iter_messages(log_time_order=False)
            ]

    def __getitem__(self, topic):
        return [(time * 1e-9, content) for t, _, time, content in self.messages if t == topic]

    @property
    def topics(self):
        return Counter(topic for topic, *_ in self.messages)


@pytest.fixture(scope="module")
def grasp():
    recording = synthetic_recording("grasp", 0, ("thumb", "index"))
    return replace(recording, markers=((2.5, "grasped"),))


@pytest.fixture(scope="module")
def model():
    return Model.load("builtin:noise-floor")


@pytest.fixture(scope="module")
def folder(grasp, model, tmp_path_factory):
    out = tmp_path_factory.mktemp("foxglove") / "view"
    assert export([grasp], out, model=model)["files"] == 1
    return out


@pytest.fixture(scope="module")
def file(folder):
    return File(folder / "grasp.mcap")


def pressed(force, n=100):
    """A recording of a sensor of 5 taxels; from 1 s on, the first reads `force`."""
    readings = np.full((n, 5, 3), 1000.0)
    readings[50:, 0] += force
    return Recording(
        "pressed", {"finger1": Tactile(sensor("anyskin"), np.arange(n) / 50, readings)}
    )


def exported(recording, tmp_path, **options):
    export([recording], tmp_path / "view", **options)
    return File(next((tmp_path / "view").glob("*.mcap")))


def test_every_topic_has_its_schema_and_the_messages_are_in_order(file):
    assert file.topics == {
        "/tf": 1,
        "/holdfast/taxels": 1,
        "/holdfast/arrows": 345,
        "/holdfast/force": 1725,
        "/holdfast/instability": 1725,
        "/holdfast/stable_probability": 1725,
        **{topic: n for topic, n in file.topics.items() if re.search("state|label|log", topic)},
    }
    times = [time for _, _, time, _ in file.messages]
    assert times == sorted(times)
    for schema in file.summary.schemas.values():
        assert schema.encoding == "jsonschema"
        assert json.loads(schema.data) == {"title": schema.name, **SCHEMAS[schema.name]}
    assert {channel.message_encoding for channel in file.summary.channels.values()} == {"json"}


def test_contents_have_the_fields_of_their_schema(file):
    def check(content, schema, place):
        kind = schema.get("type")
        if kind == "object" and "properties" in schema:
            assert set(content) <= set(schema["properties"]), place
            for name, value in content.items():
                check(value, schema["properties"][name], f"{place}.{name}")
        elif kind == "array":
            for value in content:
                check(value, schema["items"], place)
        else:
            types = {"number": (int, float), "integer": int, "string": str, "boolean": bool,
                     "object": dict, "null": type(None)}  # fmt: skip
            kinds = [kind] if isinstance(kind, str) else kind
            assert any(isinstance(content, types[name]) for name in kinds), place

    for topic, schema, _, content in file.messages[::50] + file.messages[:5]:
        check(content, SCHEMAS[schema], topic)


def test_numbers_are_those_of_the_detector(file, grasp, model):
    detection = detect(model, grasp)
    for topic, column in (
        ("/holdfast/instability", "instability"),
        ("/holdfast/stable_probability", "stable_probability"),
    ):
        time, content = file[topic][1000]
        assert time == pytest.approx(grasp.modules["thumb"].times[1000], abs=1e-9)
        for scalar in content["scalars"]:
            trace = detection.fingers[scalar["label"]]
            assert scalar["value"] == getattr(trace, column)[1000]
    force = {x["label"]: x["value"] for x in file["/holdfast/force"][1000][1]["scalars"]}
    trace = detection.fingers["thumb"]
    assert force["thumb"] == pytest.approx(np.linalg.norm(trace.force[1000]))


def test_states_and_alarms_are_those_of_the_detector(file, grasp, model):
    trace = detect(model, grasp).fingers["index"]
    sent = file["/holdfast/state/index"]
    states = ("UNKNOWN", "NO_CONTACT", "UNSTABLE", "STABLE")
    for (time, content), (following, _) in pairwise(sent):
        assert following - time <= 1.0 + 1e-6
        inside = (trace.times > time - 1e-6) & (trace.times < following - 1e-6)
        assert {states[code] for code in trace.state[inside]} == {content["state"]}
    n_alarms = sum(before == 3 and now not in (0, 3) for before, now in pairwise(trace.state))
    log = [content for _, content in file["/holdfast/log"]]
    assert n_alarms > 0
    alarms = [x for x in log if x["name"] == "index" and x["message"].startswith("alarm")]
    assert len(alarms) == n_alarms
    assert all(alarm["level"] == 3 and "was STABLE" in alarm["message"] for alarm in alarms)
    (marker,) = [content for content in log if content["name"] == "marker"]
    assert (marker["message"], marker["timestamp"]) == ("grasped", {"sec": 2, "nsec": 500000000})


def test_labels_are_states(file, grasp):
    sent = [content["state"] for _, content in file["/holdfast/label/thumb"]]
    changes = [state for k, state in enumerate(sent) if k == 0 or sent[k - 1] != state]
    assert changes == [label.state.value for label in grasp.modules["thumb"].labels]


def test_an_arrow_is_at_its_taxel_and_points_along_the_reading(tmp_path):
    skin = sensor("anyskin")
    force = np.array([30.0, -40.0, 120.0])
    file = exported(pressed(force), tmp_path)
    before, after = file["/holdfast/arrows"][10][1], file["/holdfast/arrows"][-1][1]
    assert before["entities"][0]["arrows"] == []
    (entity,) = after["entities"]
    (arrow,) = entity["arrows"]
    assert entity["frame_id"] == "module/finger1"
    assert arrow["shaft_length"] + arrow["head_length"] == pytest.approx(LONGEST_ARROW, abs=1e-6)
    place = [arrow["pose"]["position"][a] for a in "xyz"]
    assert place == pytest.approx(skin.positions[0], abs=1e-6)
    x, y, z, w = (arrow["pose"]["orientation"][a] for a in "xyzw")
    along_x = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    assert along_x == pytest.approx(skin.rotations[0] @ force / 130.0, abs=1e-4)


def test_orientations_turn_the_x_axis():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z, w = orientations(directions).T
    turned = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    assert np.abs(turned - directions).max() < 1e-12


def test_a_gap_has_no_arrows_and_no_value(tmp_path):
    still, short = pressed([0, 0, 50.0]), pressed([0, 0, 50.0], 60)
    both = Recording("both", {"a": still.modules["finger1"], "b": short.modules["finger1"]})
    file = exported(both, tmp_path)
    last = file["/holdfast/arrows"][-1][1]["entities"]
    assert [len(entity["arrows"]) for entity in last] == [1, 0]
    values = [x["value"] for x in file["/holdfast/force"][-1][1]["scalars"]]
    assert values == [pytest.approx(50.0), None]


def test_declared_baselines_and_newtons_under_load_keep_the_load(tmp_path):
    module = pressed([0, 0, 0]).modules["finger1"]
    base = np.full((5, 3), 990.0).tolist()
    declared = Recording("a", {"finger1": module}, {"baselines": {"finger1": base}})
    entity = exported(declared, tmp_path)["/holdfast/arrows"][0][1]["entities"][0]
    assert len(entity["arrows"]) == 5
    held = Recording("b", {"finger1": replace(module, unit="N")}, {"starts_loaded": True})
    (tmp_path / "b").mkdir()
    entity = exported(held, tmp_path / "b")["/holdfast/arrows"][0][1]["entities"][0]
    assert len(entity["arrows"]) == 5


def test_frames_move_with_the_measured_tips(tmp_path):
    recording = pressed([0, 0, 50.0])
    times = recording.modules["finger1"].times
    pose = np.column_stack([times, 0 * times, 0 * times, 0 * times + 1, *[0 * times] * 3])
    truth = Truth(
        times,
        {"object_pose": pose, "phase": np.array(["free"] * 50 + ["slipping"] * 50)},
        {"finger1": {"tip_pose": pose, "slip_speed": 0.001 * times}},
    )
    file = exported(replace(recording, truth=truth), tmp_path)
    sent = file["/tf"]
    assert len(sent) == len(file["/holdfast/arrows"]) == 60
    for time, content in (sent[0], sent[-1]):
        names = [t["child_frame_id"] for t in content["transforms"]]
        assert names == ["module/finger1", "object"]
        moved = content["transforms"][0]["translation"]["x"]
        assert moved == pytest.approx(time, abs=0.02)
    assert file.metadata["frames"] == "measured poses"
    assert file["/holdfast/truth/slip_speed"][50][1]["scalars"][0]["value"] == pytest.approx(1.0)
    assert {content["state"] for _, content in file["/holdfast/phase"]} == {"free", "slipping"}


def test_times_before_1970_are_shifted(tmp_path):
    recording = pressed([0, 0, 50.0])
    module = recording.modules["finger1"]
    early = replace(recording, modules={"finger1": replace(module, times=module.times - 100.0)})
    file = exported(early, tmp_path)
    assert min(time for _, _, time, _ in file.messages) == 0
    assert file.metadata["time_offset"] == "100.0"


def test_any_name_of_a_module_gives_a_topic_of_its_own(tmp_path):
    module = replace(
        pressed([0, 0, 1.0]).modules["finger1"],
        labels=synthetic_recording("x", 0).modules["thumb"].labels[:1],
    )
    recording = Recording("odd", dict.fromkeys(("a b", "a_b", 'a"b'), module))
    file = exported(recording, tmp_path)
    topics = [topic for topic in file.topics if topic.startswith("/holdfast/label/")]
    assert len(topics) == 3
    assert all(re.fullmatch("[A-Za-z0-9_/]+", topic) for topic in topics)


def panels(content):
    if content["type"] == "panel":
        yield content
    else:
        for item in content["items"]:
            assert item["proportion"] > 0
            yield from panels(item["content"])


def test_every_path_of_the_layout_leads_to_messages(folder, file):
    document = json.loads((folder / LAYOUT_FILE).read_text())
    assert document["version"] == 1
    assert document["content"]["type"] == "split"
    kinds = {panel["title"]: panel["panelType"] for panel in panels(document["content"])}
    assert kinds == {
        "Hand": "ThreeDee",
        "Log": "Log",
        "Force": "Plot",
        "Instability": "Plot",
        "P(stable)": "Plot",
        "States": "StateTransitions",
    }
    for panel in panels(document["content"]):
        config = panel["config"]
        for topic in [*config.get("topics", {}), config.get("topicToRender")]:
            assert topic is None or topic in file.topics
        for path in config.get("paths", []):
            topic, rest = path["value"].split(".", 1)
            first = file[topic][0][1]
            if panel["panelType"] == "Plot":
                label = re.fullmatch(r'scalars\[:\]\{label=="(.+)"\}\.value', rest)[1]
                assert label in [scalar["label"] for scalar in first["scalars"]]
            else:
                assert rest in first


def test_a_layout_leaves_out_what_is_not_there():
    titles = [x["title"] for x in panels(layout(["thumb"], ["/holdfast/force"])["content"])]
    assert titles == ["Hand", "Log", "Force"]


def test_several_recordings_share_a_folder_and_no_file_is_overwritten(tmp_path):
    out = tmp_path / "view"
    export([pressed([0, 0, 1.0])], out)
    before = (out / "pressed.mcap").read_bytes()
    other = replace(pressed([0, 0, 9.0]), name="other")
    with pytest.raises(OutputError, match=r"holdfast-layout\.json exists already"):
        export([other], out)
    assert sorted(path.name for path in out.iterdir()) == [LAYOUT_FILE, "pressed.mcap"]
    export([other], out, force=True)
    assert (out / "pressed.mcap").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["view"]
