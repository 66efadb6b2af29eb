import pytest

from command_line import Verb

pytestmark = pytest.mark.slow

VERB = Verb("export")


@pytest.fixture
def grasp(grasps):
    return grasps / "new" / "grasp-2.parquet"


def test_json_has_the_sizes(capsys, grasp, tmp_path):
    words = ("builtin:any", tmp_path / "model.h", "--like", grasp, "--float")
    document = VERB.document(capsys, *words)
    assert document["fingers"] == ["thumb", "index"]
    assert document["state_size"] > 10_000 and "track.time" in document["double_fields"]


def test_tables_say_what_they_leave_out_and_are_overwritten_by_force(capsys, grasp, tmp_path):
    out = tmp_path / "csv"
    out.mkdir()
    (out / "grasp-2.csv").write_text("mine")
    code, printed, err = VERB.run(capsys, grasp, out, "--format", "csv", "--force")
    assert (code, printed.split(":")[0]) == (0, str(out))
    assert err == "a CSV table has no metadata\n"
    assert (out / "grasp-2.csv").read_text().startswith("# sensor")
    assert VERB.document(capsys, grasp, out, "--format", "csv", "--force")["format"] == "csv"
