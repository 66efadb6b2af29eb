import json
import os
import signal
import subprocess
import sys
import time
from urllib.request import Request, urlopen

from holdfast.contact import ContactState
from holdfast.io import load_recording
from holdfast.recordings import Label

TIMEOUT = 60.0


def test_the_page_is_served_and_keeps_what_was_saved_when_killed(folder):
    words = ["-c", "import sys; from holdfast.cli import main; sys.exit(main())"]
    process = subprocess.Popen(
        [sys.executable, *words, "label", str(folder), "--port", "0", "--no-browser", "--json",
         "--author", "ada"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        url = json.loads(process.stdout.readline())["url"]
        with urlopen(f"{url}api/v1/recordings", timeout=TIMEOUT) as answer:
            listed = json.loads(answer.read())
        assert listed["author"] == "ada"
        assert [each["name"] for each in listed["recordings"]] == ["one", "two"]
        save(url, [{"start": 2.0, "end": 3.0, "state": "stable"}])
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
    labels = load_recording(folder / "one.parquet").modules["thumb"].labels
    assert labels == (Label(2.0, 3.0, ContactState.STABLE, author="ada"),)


def save(url, labels):

    body = {"labels": {"thumb": labels}, "note": "", "author": "", "revision": "none"}
    request = Request(f"{url}api/v1/recordings/0/labels", json.dumps(body).encode(), method="PUT")
    deadline = time.monotonic() + TIMEOUT
    with urlopen(request, timeout=deadline - time.monotonic()) as answer:
        assert answer.status == 200
