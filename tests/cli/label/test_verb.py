import pytest

from .helpers import run


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--auto", "magic", "F"), "unknown rule 'magic'; there are signal, tracking, command"),
        (("--auto", "signal", "F", "--tare", "soon"), "tare: seconds above 0"),
        (("--auto", "signal", "F", "--set", "share"), "--set NAME=VALUE expected, 'share' given"),
        (("--auto", "signal", "F", "--set", "magic=1"), "rule 'signal' has no parameter magic"),
        (("--auto", "signal", "F", "--poses", "p.csv"), "--poses are for the rule tracking; rule"),
        (("--auto", "tracking", "F", "--poses", "gone.csv"), "cannot read gone.csv: No such file"),
        (
            ("--auto", "tracking", "F", "--poses", "a.bag"),
            "a.bag is not a .csv file, so it is read as a bag: ",
        ),
        (
            ("--auto", "tracking", "F", "--poses", "a.bag", "--track", "object=/pose"),
            "a.bag does not exist; a file or folder to import expected",
        ),
        (
            ("--auto", "tracking", "F", "--track", "object=/pose"),
            "--track names topics or frames of a bag: give --poses BAG (or stickers of a video: "
            "give --video FILE)",
        ),
        (("--auto", "signal", "gone"), "gone does not exist; a recording or a folder expected"),
        (("--auto", "signal", "F", "--compare"), "--auto and --compare given; only one of them"),
        (("--page", "F"), "--page shows the result of --audit: give --audit as well"),
        (("--compare", "F"), "--compare A B: two paths expected, 1 given"),
        (("--compare", "signal", "tracking"), "rules signal and tracking given; A or B must be"),
        (("--compare", "F", "gone"), "gone does not exist; labels, recordings or a rule expected"),
        (("--compare", "F", "command"), "nothing to compare: one: recording 'one' has no marker"),
        (("--export", "yaml", "out", "F"), "--export label-studio or csv expected, 'yaml' given"),
        (("--import", "gone.json", "F"), "gone.json does not exist; labels of Label Studio or CSV"),
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


@pytest.mark.parametrize(
    ("before", "now"),
    [
        ("--auto signal F --dry-run --json", "auto signal F --dry-run --json"),
        ("--auto signal F --dry-run --tare first", "auto signal F --dry-run --tare first"),
        ("--auto magic F", "auto magic F"),
        ("--compare F signal --json", "compare F signal --json"),
        ("--compare F gone", "compare F gone"),
        ("--audit gone --page", "audit gone --page"),
        ("--export csv O F --force", "export csv O F --force"),
        ("--import O F --dry-run --author ann", "import O F --dry-run --author ann"),
        ("--import gone.json F", "import gone.json F"),
    ],
)
def test_commands_do_what_the_options_did(capsys, folder, tmp_path, before, now):
    places = {"F": folder, "O": tmp_path / "out"}
    if "import" in now:
        run(capsys, "export", "csv", places["O"], folder)
    first, second = (
        run(capsys, *(places.get(word, word) for word in text.split())) for text in (before, now)
    )
    assert first == second
    assert first[0] == (2 if "gone" in now or "magic" in now else 0)
