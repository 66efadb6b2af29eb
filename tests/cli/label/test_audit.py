import pytest

from holdfast.cli.label import page
from holdfast.io import load_recording, save_recording
from holdfast.labelling.review.audit import Audit, Suspect

from .helpers import run, run_json

SUSPECT = Suspect("one", "thumb", "edge", 1.0, 1.5, "stable", "unstable", 0.9, 0.5)


@pytest.fixture
def audited(monkeypatch):
    """Replace the audit by one that finds one suspect; return its arguments."""
    given = []

    def audit(recordings, **_):
        given.append([recording.name for recording in recordings])
        return Audit(len(recordings), 20.0, [SUSPECT])

    monkeypatch.setattr("holdfast.labelling.review.audit.audit", audit)
    return given


def test_an_audit_is_printed(capsys, folder, audited):
    found = run_json(capsys, "--audit", folder)
    assert found["suspects"][0]["recording"] == "one"
    assert found["suspects"][0]["shift"] == 0.5
    code, out, _ = run(capsys, "--audit", folder)
    assert code == 0
    lines = out.splitlines()
    assert max(map(len, lines)) <= 80
    assert next(line for line in lines if line.startswith("one ")).split() == [
        "one", "thumb", "edge", "1.00", "1.50", "stable", "unstable", "0.90", "+0.50",
    ]  # fmt: skip
    assert lines[-1] == "1 suspects in 20.0 s of labels of 2 recordings"
    assert audited == [["one", "two"]] * 2


def test_an_audit_is_shown_on_the_page(capsys, folder, audited, monkeypatch):
    shown = []
    monkeypatch.setattr(
        page,
        "show_label_page",
        lambda paths, *_, suspects, **__: shown.append((paths, suspects)),
    )
    assert run(capsys, "--audit", folder, "--page", "--no-browser")[0] == 0
    assert shown == [([folder], [SUSPECT])]


def test_an_audit_needs_labels(capsys, folder):
    for path in folder.iterdir():
        recording = load_recording(path).with_labels({})
        save_recording(recording, path, force=True)
    code, out, err = run(capsys, "--audit", folder)
    assert (code, out) == (2, "")
    assert err.splitlines()[-1].startswith("holdfast: ")
