import json
import os
import signal
import threading
import time
import urllib.error
import urllib.request

import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.cli import serve as verb
from holdfast.devices.sources import Source
from holdfast.errors import SourceError
from holdfast.io import load_recording, save_recording
from holdfast.synthetic import synthetic_recording

MODEL = "builtin:twin"


@pytest.fixture
def grasp(tmp_path):
    save_recording(synthetic_recording("grasp", 1), tmp_path / "grasp.parquet")
    return tmp_path / "grasp.parquet"


@pytest.fixture
def when_served(monkeypatch):
    """Run a function in a thread when the page can be opened; then stop the service."""

    def arrange(work):
        found = []

        def run(document):
            try:
                found.append(work(document["url"]))
            except Exception as failure:
                found.append(failure)
            finally:
                os.kill(os.getpid(), signal.SIGINT)

        real = verb.print_json

        def print_and_start(document):
            real(document)
            threading.Thread(target=run, args=(document,)).start()

        monkeypatch.setattr(verb, "print_json", print_and_start)
        return found

    return arrange


run = Verb("serve").run


def refusal(capsys, *words):
    code, out, err = run(capsys, *words)
    *waits, last = err.splitlines()  # what it waits for, where that takes longer
    assert all(text.startswith(("loading ", "simulating ")) for text in waits)
    assert (code, out) == (2, "")
    return last.removeprefix("holdfast: ")


def ask(url, method="GET", **headers):
    request = urllib.request.Request(url, method=method, headers=headers)
    with urllib.request.urlopen(request) as answer:
        return json.load(answer)


def test_the_service_runs_until_ctrl_c(capsys, grasp, when_served):
    found = when_served(lambda url: ask(f"{url}api/v1/info"))
    code, out, err = run(capsys, MODEL, grasp, "--port", 0, "--json")
    assert code == 0
    document = json.loads(out)
    assert document["source"] == str(grasp)
    assert document["url"] in err
    assert found[0]["model"] == MODEL
    assert set(found[0]["fingers"]) == {"thumb", "index", "middle"}


def test_a_recording_is_ended_with_the_service(capsys, grasp, when_served, tmp_path):
    def work(url):
        begun = ask(f"{url}api/v1/recording", "POST")
        while not (ask(f"{url}api/v1/state").get("recording") or {}).get("seconds"):
            time.sleep(0.05)
        return begun

    found = when_served(work)
    words = ("--port", 0, "--json", "--record-to", tmp_path / "made", "--speed", 4)
    assert run(capsys, MODEL, grasp, *words)[0] == 0
    assert load_recording(found[0]["path"]).complete


def test_the_token_is_needed(capsys, grasp, when_served):
    def work(url):
        with pytest.raises(urllib.error.HTTPError, match="401"):
            ask(f"{url.partition('?')[0]}api/v1/info")
        return ask(f"{url.partition('?')[0]}api/v1/info", Authorization="Bearer s&cret-long")

    found = when_served(work)
    code, out, _ = run(capsys, MODEL, grasp, "--port", 0, "--json", "--token", "s&cret-long")
    assert code == 0
    assert json.loads(out)["url"].endswith("?token=s%26cret-long")
    assert found[0]["type"] == "hello"


def test_the_token_of_a_file_or_of_the_environment(
    capsys, grasp, when_served, tmp_path, monkeypatch
):
    file = tmp_path / "token.txt"
    file.write_text("  from-a-file\nsecond line\n")
    monkeypatch.setenv("HOLDFAST_TOKEN", "from-the-environment")
    for words, token in (
        (("--token-file", file), "from-a-file"),
        ((), "from-the-environment"),
        (("--token", "from-the-option"), "from-the-option"),
    ):
        when_served(lambda url: None)
        code, out, _ = run(capsys, MODEL, grasp, "--port", 0, "--json", *words)
        assert code == 0
        assert json.loads(out)["url"].endswith(f"?token={token}")


def test_tokens_that_are_refused(capsys, grasp, tmp_path):
    none, binary = tmp_path / "none", tmp_path / "binary"
    binary.write_bytes(b"\xff\xfe\n")
    for words, text in (
        (("--token", "7 bytes"), "--token: at least 8 characters expected, 7 given"),
        (("--token-file", none), f"--token-file {none}: a file expected, there is none"),
        (("--token-file", tmp_path), f"--token-file {tmp_path}: a file expected, there is none"),
        (("--token-file", binary), f"--token-file {binary}: text expected, other bytes given"),
        (
            ("--token-file", none, "--token", "x" * 9),
            "--token and --token-file given; only one of them expected",
        ),
    ):
        assert refusal(capsys, MODEL, grasp, *words) == text


def test_a_model_without_a_slip_rule_is_reported_once(capsys, grasp):
    words = ("builtin:noise-floor", grasp, "--once", "--speed", 20, "--port", 0, "--json")
    code, out, err = run(capsys, *words)
    assert code == 0
    assert err.count("builtin:noise-floor has no slip rule: slip_probability is null") == 1
    assert "slip rule" not in out


def test_once_ends_with_the_recording(capsys, grasp):
    code, out, err = run(capsys, MODEL, grasp, "--once", "--speed", 20, "--port", 0)
    assert (code, out) == (0, "")
    assert "Ctrl-C stops it" in err


def test_refusals(capsys, grasp, tmp_path):
    assert refusal(capsys, MODEL, grasp, "--host", "0.0.0.0") == (
        "--host 0.0.0.0 opens the service to the network: give --token SECRET as well "
        "(or --token-file FILE, or HOLDFAST_TOKEN in the environment)"
    )
    assert refusal(capsys, MODEL, tmp_path / "none.parquet") == (
        f"{tmp_path / 'none.parquet'} does not exist; a recording's file expected"
    )
    assert refusal(capsys, "builtin:best", grasp).startswith("unknown model 'builtin:best'")
    assert refusal(capsys, MODEL, grasp, "--speed=-1") == "--speed: at least 0 expected, -1 given"
    assert refusal(capsys, MODEL, "xela://127.0.0.1:1", "--speed", 2) == (
        "--speed is for recordings and the twin; xela://127.0.0.1:1 is a device"
    )
    assert "port" in refusal(capsys, MODEL, grasp, "--port", 99999)
    assert refusal(capsys, MODEL, grasp, "--ignore", "index").startswith("--ignore: FINGER:TAXEL")
    for taxel in (0, 31):
        assert refusal(capsys, MODEL, grasp, "--ignore", f"thumb:1,thumb:{taxel}") == (
            f"thumb: taxel {taxel} to be ignored; it has the taxels 1 to 30"
        )


class Slow(Source):
    """Source that has no packet while it is opened, and then fails."""

    name = "xela://127.0.0.1:1"

    def open(self):
        time.sleep(0.5)
        raise SourceError("no packet came")

    def read(self, timeout):
        return None

    def close(self):
        pass


@pytest.mark.parametrize("command", [("serve", MODEL), ("play",)])
def test_what_it_waits_for_is_printed(capsys, monkeypatch, command):
    monkeypatch.setattr("holdfast.devices.sources.open_source", lambda *_, **__: Slow())
    assert main([*command, Slow.name, "--port", "0", "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "waiting for the first packet of xela://127.0.0.1:1" in err.splitlines()
    assert err.splitlines()[-1] == "holdfast: no packet came"
