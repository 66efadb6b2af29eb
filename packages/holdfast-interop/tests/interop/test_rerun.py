"""Files and the live view of Rerun, read back by its own reader; .ci/rerun runs this."""

from dataclasses import replace

import numpy as np
import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.detection import Model, detect
from holdfast.detection.traces import STATE_BY_CODE
from holdfast.errors import is_installed
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_interop.scene.tracks import events

needs_rerun = pytest.mark.skipif(not is_installed("rerun"), reason="Rerun is not installed")


@pytest.fixture(scope="module")
def grasp():
    recording = synthetic_recording("grasp", 0, ("thumb", "index"))
    return replace(recording, markers=((2.5, "grasped"),))


@pytest.fixture(scope="module")
def model():
    return Model.load("builtin:noise-floor")


def entities(path):
    """Return the columns of each entity of a file, as lists by name; times are in ns."""
    from pyarrow import types
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).stream():
        batch, columns = chunk.to_record_batch(), found.setdefault(chunk.entity_path, {})
        for name, values in zip(batch.schema.names, batch.columns, strict=True):
            numbers = values.cast("int64") if types.is_temporal(values.type) else values
            columns.setdefault(name.rpartition(":")[2], []).extend(numbers.to_pylist())
    return found


@pytest.fixture(scope="module")
def file(grasp, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rerun")
    save_recording(grasp, folder / "grasp.mcap")
    words = ["--format", "rerun", "--model", "builtin:noise-floor"]
    assert main(["export", str(folder / "grasp.mcap"), str(folder / "view"), *words]) == 0
    return folder / "view" / "grasp.rrd"


@pytest.mark.skipif(is_installed("rerun"), reason="Rerun is installed")
def test_what_is_missing_is_one_line_with_the_command(capsys, grasp, tmp_path):
    save_recording(grasp, tmp_path / "grasp.mcap")
    words = (tmp_path / "grasp.mcap", tmp_path / "view", "--format", "rerun")
    assert "pip install 'rerun-sdk>=0.41'" in Verb("export").refusal(capsys, *words)
    words = ["builtin:any", str(tmp_path / "grasp.mcap"), "--rerun", "--port", "0", "--once"]
    assert "rerun-sdk" in Verb("serve").refusal(capsys, *words)


@needs_rerun
class TestFile:
    def test_force_and_states_are_those_of_detect(self, file, grasp, model):
        found, traces = entities(file), detect(model, grasp).fingers
        for finger, trace in traces.items():
            force = found[f"/force/{finger}"]["scalars"]
            np.testing.assert_allclose(np.concatenate(force), np.linalg.norm(trace.force, axis=1))
            times = np.array(found[f"/force/{finger}"]["time"]) * 1e-9
            np.testing.assert_allclose(times, trace.times - grasp.start, atol=1e-6)
            changes = np.flatnonzero(np.diff(trace.state, prepend=-1))
            words = [STATE_BY_CODE[code].value for code in trace.state[changes].tolist()]
            lane = found[f"/states/{finger}"]
            assert [word for row in lane["state"] if row for word in row] == words

    def test_events_are_a_log(self, file, grasp, model):
        log = entities(file)["/events"]["text"]
        expected = [f"{e.name}: {e.text}" for e in events(grasp, detect(model, grasp).fingers)]
        assert [row[0] for row in log] == expected
        assert "marker: grasped" in expected

    def test_taxels_are_points_with_arrows(self, file, grasp):
        found = entities(file)
        sensor = grasp.modules["thumb"].sensor
        points = found["/hand/palm_link/thumb/taxels"]["positions"]
        np.testing.assert_allclose(points[0], sensor.positions, atol=1e-7)
        arrows = found["/hand/palm_link/thumb/arrows"]["vectors"]
        assert len(arrows) == int(grasp.duration * 30) + 1
        assert max(map(len, arrows)) <= sensor.n_taxels
        assert np.linalg.norm(np.concatenate([a for a in arrows if a]), axis=1).max() > 0.015
