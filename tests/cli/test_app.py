import os
import subprocess
import sys
from importlib import metadata

import pytest

from holdfast.cli import app, main
from holdfast.errors import RecordingError
from holdfast.removed import REMOVED


def run(*words, stdout=subprocess.PIPE, **options):
    program = "import sys; from holdfast.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", program, *words]
    options |= {"stdout": stdout, "stderr": subprocess.PIPE}
    return subprocess.run(command, text=True, check=False, **options)


@pytest.fixture
def failing(monkeypatch):
    """Return a function that makes the verb `doctor` raise an exception."""

    def arrange(failure):
        def verb() -> None:
            raise failure

        monkeypatch.setattr(app, "load_verb", lambda name: verb)

    return arrange


def one_line(capsys):
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    return err.rstrip("\n")


@pytest.mark.parametrize("verb", [*app.VERBS, *app.SUB_VERBS])
def test_every_verb_has_help_with_an_example(verb, capsys):
    assert main([*verb.split(), "--help"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert f"\n  Example:\n    holdfast {verb}" in out
    assert "--json" in out


@pytest.mark.parametrize(
    ("verb", "line"), [*app.VERBS.items(), *app.SUB_VERBS.items()], ids=[*app.VERBS, *app.SUB_VERBS]
)
def test_help_lists_the_first_line_of_every_verb(verb, line):
    assert app.load_verb(verb).__doc__.splitlines()[0] == line


def test_the_help_of_a_verb_lists_its_commands(capsys):
    assert main(["label", "--help"]) == 0
    out = capsys.readouterr().out
    for name, line in app.SUB_VERBS.items():
        assert f"\n  {name.split()[1]:9}{line}\n" in out


def test_without_words_the_help_is_shown(capsys):
    assert main([]) == 0
    out = capsys.readouterr().out
    assert "holdfast demo" in out
    assert all(len(line) <= 80 for line in out.splitlines())


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"holdfast {metadata.version('holdfast-tactile')}\n"


def complete(*words):
    typed = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    done = run(env={**os.environ, **typed, "_HOLDFAST_COMPLETE": "complete_bash"})
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


def test_a_shell_completes_verbs_and_options():
    assert sorted(complete("holdfast", "de")) == ["demo", "detect"]
    assert complete("holdfast", "detect", "--hy") == ["--hysteresis"]


def test_help_names_every_verb_and_loads_nothing_heavy():
    code = (
        "import sys; from holdfast.cli import main; main(['--help']); "
        "print(*{'numpy', 'scipy', 'sklearn', 'pyarrow', 'matplotlib', 'rich', 'msgspec'}"
        " & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == ""
    for verb, summary in app.VERBS.items():
        assert f"{verb:11}{summary}"[:60] in done.stdout


@pytest.mark.parametrize(
    ("failure", "code", "message"),
    [
        (RecordingError("no\n samples"), 2, "no samples"),
        (ValueError("13 given"), 2, "13 given"),
        (TypeError("a path expected"), 2, "a path expected"),
        (FileNotFoundError(2, "No such file", "a.mcap"), 2, "a.mcap: No such file"),
        (OSError(28, "No space left on device"), 2, "[Errno 28] No space left on device"),
        (MemoryError(), 2, "MemoryError"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (KeyError("thumb"), 1, "internal error (KeyError: 'thumb'): please report it"),
    ],
)
def test_a_failure_is_one_line(failing, failure, code, message, capsys, monkeypatch):
    monkeypatch.delenv("HOLDFAST_DEBUG", raising=False)
    failing(failure)
    assert main(["doctor"]) == code
    assert one_line(capsys) == f"holdfast: {message}"


def test_a_traceback_only_with_holdfast_debug(failing, capsys, monkeypatch):
    monkeypatch.setenv("HOLDFAST_DEBUG", "1")
    failing(KeyError("thumb"))
    assert main(["doctor"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_a_closed_pipe_is_no_failure():
    reading, writing = os.pipe()
    os.close(reading)
    done = run("sensors", stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_exit_code_reaches_the_shell():
    done = run("sensors", "nothing")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


@pytest.mark.parametrize("verb", ["detect", "serve", "record", "calibrate", "hold"])
@pytest.mark.parametrize("words", [(), ("builtin:any", "none.mcap")])
def test_settings_that_still_lie_here_are_named_once(verb, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    without = main([verb, *words]), *capsys.readouterr()
    (tmp_path / "holdfast.toml").write_text('model = "builtin:any"\nignore = {thumb = [1]}\n')
    code, out, err = main([verb, *words]), *capsys.readouterr()
    notice, _, rest = err.partition("\n")
    assert (code, out, rest) == without
    assert "holdfast.toml" in notice
    assert notice.endswith(REMOVED["files"]["holdfast.toml"])
