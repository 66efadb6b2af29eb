import json

import pytest

from holdfast.errors import OutputError, RecordingError
from holdfast.live.teaching.folder import TeachingFolder
from holdfast.live.teaching.protocol import GraspResult
from traps import traps

HOLD = GraspResult("hold", 1, 9.5, True, "001-hold", "held for 9 s")
REPEATED = GraspResult("pull", 1, 9.5, False, "002-pull", "no slide seen")


def test_results_are_kept_and_a_protocol_is_resumed(tmp_path):
    path = tmp_path / "grasps"
    folder = TeachingFolder(path, resume=False)
    assert not path.exists()
    folder.save([])
    assert folder.new_path("hold") == path / "001-hold.mcap"
    for name in ("001-hold.mcap", "002-pull.mcap", "002-pull.mp4", "002-pull.labels.json"):
        (path / name).write_text(name)
    folder.save([HOLD, REPEATED])
    assert sorted(p.name for p in path.iterdir()) == ["001-hold.mcap", "left-out", "teach.json"]
    assert sorted(p.name for p in folder.aside.iterdir()) == [
        "002-pull.labels.json", "002-pull.mcap", "002-pull.mp4"
    ]  # fmt: skip
    again = TeachingFolder(path, resume=True)
    assert again.results == [HOLD, REPEATED]
    assert again.kept == [HOLD]
    assert again.new_path("pull").name == "003-pull.mcap"  # that of no other recording


def test_what_is_not_its_own_is_refused(tmp_path):
    begun, other, none = tmp_path / "begun", tmp_path / "other", tmp_path / "none"
    TeachingFolder(begun, resume=False).save([HOLD])
    other.mkdir()
    (other / "mine.mcap").write_text("")
    for path, resume, words in (
        (begun, False, "--resume goes on with it, --to FOLDER begins another"),
        (other, True, "no teach.json"), (none, True, "no teach.json"),
    ):  # fmt: skip
        with pytest.raises((OutputError, RecordingError), match=f"^{path} .*{words}"):
            TeachingFolder(path, resume=resume)
    assert not none.exists()


@pytest.mark.parametrize("content", ["", "[", json.dumps([{"name": 3}])])
def test_results_that_cannot_be_read_are_an_error(tmp_path, content):
    (tmp_path / "teach.json").write_text(content)
    with pytest.raises(RecordingError, match=r"teach\.json has no results of a protocol: "):
        TeachingFolder(tmp_path, resume=True)


@traps
def test_no_journal_is_read_but_a_file(tmp_path, word, trap):
    trap(tmp_path / "teach.json")
    with pytest.raises((OutputError, RecordingError), match=rf"it is a {word}|has no teach\.json"):
        TeachingFolder(tmp_path, resume=True)


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file/grasps"):
        TeachingFolder(tmp_path / "file" / "grasps", resume=False).save([])
