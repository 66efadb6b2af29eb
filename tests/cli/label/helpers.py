"""Functions that run `holdfast label`."""

import json
from dataclasses import replace

from command_line import Verb
from holdfast.io import load_recording, save_labels

FINGERS = ("thumb", "index")


VERB = Verb("label")
run, refusal = VERB.run, VERB.refusal


def run_json(capsys, *words):
    """Run the verb with --json, and return its output."""
    code, out, err = run(capsys, *words, "--json")
    assert code == 0, err
    return json.loads(out)


def save_manual_labels(path, author="ada", notes="careful"):
    """Save the labels within a recording as those of a person."""
    recording = load_recording(path, labels=False)
    signed = {
        name: [replace(label, author=author) for label in module.labels]
        for name, module in recording.modules.items()
    }
    save_labels(recording.with_labels(signed), path, author=author, notes=notes, force=True)
