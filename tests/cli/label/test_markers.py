import pytest

from .helpers import refusal, run, run_json

pytest.importorskip("cv2")


def test_a_sheet_is_written_once(capsys, tmp_path):
    sheet = tmp_path / "sheet.pdf"
    code, out, err = run(capsys, "markers", sheet)
    assert (code, err) == (0, "")
    assert out == f"{sheet}: print it at 100 %, without scaling to the page\n"
    assert sheet.read_bytes().startswith(b"%PDF-1.4")
    assert "exists already" in refusal(capsys, "markers", sheet)


def test_the_sheet_as_json(capsys, tmp_path):
    assert run_json(capsys, "markers", tmp_path / "a.pdf") == {"sheet": str(tmp_path / "a.pdf")}


def test_another_suffix(capsys, tmp_path):
    message = refusal(capsys, "markers", tmp_path / "sheet.png")
    assert message == "a file with the suffix .pdf expected, 'sheet.png' given"
