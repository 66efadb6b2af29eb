import pytest

from .helpers import refusal, run


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("auto", "magic", "F"), "unknown rule 'magic'; there are signal, tracking, command"),
        (("auto", "signal", "F", "--tare", "soon"), "tare: seconds above 0"),
        (("auto", "signal", "F", "--set", "share"), "--set NAME=VALUE expected, 'share' given"),
        (("auto", "signal", "F", "--set", "magic=1"), "rule 'signal' has no parameter magic"),
        (("auto", "signal", "F", "--poses", "p.csv"), "--poses are for the rule tracking; rule"),
        (("auto", "tracking", "F", "--poses", "gone.csv"), "cannot read gone.csv: No such file"),
        (
            ("auto", "tracking", "F", "--poses", "a.bag"),
            "a.bag is not a .csv file, so it is read as a bag: ",
        ),
        (
            ("auto", "tracking", "F", "--poses", "a.bag", "--track", "object=/pose"),
            "a.bag does not exist; a file or folder to import expected",
        ),
        (
            ("auto", "tracking", "F", "--track", "object=/pose"),
            "--track names topics or frames of a bag: give --poses BAG (or stickers of a video: "
            "give --video FILE)",
        ),
        (("auto", "signal", "gone"), "gone does not exist; a recording or a folder expected"),
        (("export", "yaml", "out", "F"), "the format csv expected, 'yaml' given"),
        (("import", "gone.json", "F"), "gone.json does not exist; a file or folder of labels"),
        (("gone",), "gone does not exist; a recording or a folder expected"),
        (("F", "--host", "0.0.0.0"), "--host 0.0.0.0 opens the service to the network"),
        (("F", "--port", "99999"), "cannot listen at 127.0.0.1:99999"),
        (("F", "--tare", "soon"), "tare: seconds above 0"),
    ],
)
def test_bad_input_is_one_line(capsys, folder, words, text, monkeypatch):
    monkeypatch.chdir(folder.parent)
    (folder.parent / "p.csv").write_text("time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n")
    code, out, err = run(capsys, *("recordings" if word == "F" else word for word in words))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith(f"holdfast: {text}")


@pytest.mark.parametrize("name", ["audit", "compare"])
def test_a_folder_may_have_the_name_of_a_command_that_was_removed(
    capsys, tmp_path, monkeypatch, name
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    assert refusal(capsys, name).startswith(f"no recording in {name} (0 other entries)")
