import json
import os
import signal
import threading
import time
import urllib.error
import urllib.request

import pytest

from command_line import Verb
from holdfast.cli import serve as verb
from holdfast.cli.options import ServerOptions
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


@pytest.mark.parametrize("word", ["--browser", "--no-browser"])
def test_the_page_opens_in_a_browser_or_not(capsys, grasp, when_served, monkeypatch, word):
    opened = []
    monkeypatch.setattr("holdfast.web.server.open_browser", lambda url: not opened.append(url))
    when_served(lambda url: ask(f"{url}api/v1/info"))
    code, out, err = run(capsys, MODEL, grasp, "--port", 0, "--json", word)
    assert code == 0
    assert opened == [json.loads(out)["url"]] * (word == "--browser")
    assert ("has opened" in err) == bool(opened)


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


def test_the_token_of_a_file_or_of_the_environment(tmp_path, monkeypatch):
    file = tmp_path / "token.txt"
    file.write_text("  from-a-file\nsecond line\n")
    monkeypatch.setenv("HOLDFAST_TOKEN", "from-the-environment")
    for options, token in (
        ({"token_file": file}, "from-a-file"),
        ({}, "from-the-environment"),
        ({"token": "from-the-option"}, "from-the-option"),
    ):
        assert ServerOptions("127.0.0.1", 0, **options).find_token() == token


def test_a_recording_ends_the_service_once(capsys, grasp):
    words = ("builtin:noise-floor", grasp, "--once", "--speed", 20, "--port", 0)
    code, out, err = run(capsys, *words)
    assert (code, out) == (0, "")
    assert err.count("builtin:noise-floor has no slip rule") == 1
