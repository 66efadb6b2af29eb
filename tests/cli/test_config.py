import pytest

from holdfast.cli import app, main
from holdfast.cli.config import Config, find_config, load_config

WHOLE = """
model = "builtin:twin"
host = "10.0.0.2:5000"
sensor = "uskin-4x4"
values = "calibrated"
ignore = {index = [7, 12], thumb = [1]}
[fingers]
1 = "thumb"
2 = "index"
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HOLDFAST_CONFIG", raising=False)
    return tmp_path


@pytest.fixture
def seen(monkeypatch):
    """The arguments of a verb, which does nothing else."""
    got = {}

    def load(name):
        from holdfast.cli.options import IgnoreOption, ModelArgument, SourceArgument

        def verb(model: ModelArgument, source: SourceArgument, ignore: IgnoreOption = "") -> None:
            """Do nothing."""
            got.update(model=model, source=source, ignore=ignore)

        return verb

    monkeypatch.setattr(app, "load_verb", load)
    return got


def write(folder, text=WHOLE, name="holdfast.toml"):
    (folder / name).write_text(text)
    return folder / name


def test_a_verb_without_arguments_uses_the_file(folder, seen):
    write(folder)
    assert main(["detect"]) == 0
    assert seen == {
        "model": "builtin:twin",
        "source": "xela://10.0.0.2:5000?fingers=1:thumb,2:index&sensor=uskin-4x4&values=calibrated",
        "ignore": "index:7,index:12,thumb:1",
    }


def test_the_command_line_wins(folder, seen):
    write(folder)
    assert main(["detect", "mine.json", "xela://auto?fingers=1:ring", "--ignore", "ring:1"]) == 0
    assert seen["model"] == "mine.json"
    assert seen["source"] == "xela://auto?fingers=1:ring&sensor=uskin-4x4&values=calibrated"
    assert seen["ignore"] == "ring:1"


@pytest.mark.parametrize("source", ["grasp.parquet", "twin:?object=can"])
def test_recordings_and_the_twin_need_no_parameters(folder, seen, source):
    write(folder)
    assert main(["detect", "m", source]) == 0
    assert seen["source"] == source


def test_the_file_that_is_named_wins(folder, seen, monkeypatch):
    write(folder)
    other = write(folder, 'host = "b:1"\nmodel = "b"', "other.toml")
    third = write(folder, 'host = "c:1"\nmodel = "c"', "third.toml")
    assert find_config().name == "holdfast.toml"
    monkeypatch.setenv("HOLDFAST_CONFIG", str(other))
    assert main(["detect"]) == 0
    assert (seen["model"], seen["source"]) == ("b", "xela://b:1")
    assert main(["--config", str(third), "detect"]) == 0
    assert (seen["model"], seen["source"]) == ("c", "xela://c:1")


def test_other_verbs_do_not_read_it(folder, capsys):
    write(folder, "wrong = 1")
    assert main(["sensors"]) == 0
    assert capsys.readouterr().err == ""


def test_without_a_file(folder, seen, capsys):
    assert main(["detect", "m", "xela://auto"]) == 0
    assert seen["source"] == "xela://auto"
    assert main(["detect", "m", "hand"]) == 2
    assert "there is no holdfast.toml in this folder" in capsys.readouterr().err


def test_a_recording_may_be_named_hand(folder, seen):
    write(folder)
    (folder / "hand").touch()
    assert main(["detect", "m", "hand"]) == 0
    assert seen["source"] == "hand"


@pytest.mark.parametrize(
    ("config", "uri"),
    [
        (Config(), "xela://auto"),
        (Config(source="xela://h:1?values=counts", fingers={"1": "thumb"}, values="calibrated"),
         "xela://h:1?values=counts&fingers=1:thumb"),
        (Config(source="twin:?object=can", fingers={"1": "thumb"}), "twin:?object=can"),
        (Config(source="serial:///dev/ttyACM0?sensor=anyskin", sensor="gtac", values="counts"),
         "serial:///dev/ttyACM0?sensor=anyskin"),
    ],
)  # fmt: skip
def test_the_source_of_the_hand(config, uri):
    assert config.complete("hand") == uri


def test_files_are_beside_the_configuration(folder):
    (folder / "lab").mkdir()
    config = load_config(write(folder / "lab", 'sensor = "mine.json"\nmodel = "m.json"'))
    beside = lambda name: str(find_config(folder / "lab" / "holdfast.toml").parent / name)  # noqa: E731
    assert (config.sensor, config.model) == (beside("mine.json"), beside("m.json"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("finger = 1", "unknown key finger; there are fingers, host, ignore, model, sensor, "
         "source, values"),
        ("host = 5", "Expected `str | null`, got `int` - at `$.host`"),
        ("host = ", "is not TOML: Invalid value"),
        (f"{'a.' * 20_000}a = 1", "is not TOML: line 1: at most 16 dots in a line expected, 20000 "
         "given"),
        (f"# {'x' * 65_536}", "it has more than 65536 bytes"),
        ('host = "a"\nsource = "b"', "source or host expected, both given"),
        ('[fingers]\nthumb = "1"', "the number of a module, 'thumb' given"),
        ("ignore = {index = [-1]}", "ignore: taxels from 1 expected, -1 given for index"),
        ("ignore = {index = [7, 0]}", "ignore: taxels from 1 expected, 0 given for index"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_one_line(folder, seen, capsys, text, message):
    write(folder, text)
    assert main(["detect"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("holdfast: holdfast.toml")
    assert message in err
    assert err.count("\n") == 1
    assert seen == {}


def test_a_file_that_does_not_exist(capsys, seen, monkeypatch):
    assert main(["--config", "none.toml", "detect"]) == 2
    assert capsys.readouterr().err == "holdfast: --config: there is no file none.toml\n"
    monkeypatch.setenv("HOLDFAST_CONFIG", "none.toml")
    assert main(["detect"]) == 2
    assert capsys.readouterr().err == "holdfast: HOLDFAST_CONFIG: there is no file none.toml\n"
