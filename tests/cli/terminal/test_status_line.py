import io

import pytest

from holdfast.cli.terminal import progress
from holdfast.cli.terminal.progress import StatusLine, status_parts
from holdfast.contact import Fault
from holdfast.live.recorder import RecorderStatus

WELL = RecorderStatus(
    seconds=12.34,
    n_samples=1851,
    modules={"thumb": 1851},
    rate=149.96,
    n_gaps=0,
    n_lost=0,
    n_refused=0,
    n_dropped=0,
    n_bytes=2_500_000,
    n_markers=2,
    faults={},
    recent_faults={},
    failure="",
)
BAD = WELL._replace(
    rate=0.0,
    n_gaps=1,
    n_lost=3,
    n_dropped=4,
    recent_faults={"index": (Fault.LATE, Fault.PACKET_GAP)},
)


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Still:
    """Recorder with a constant status."""

    def __init__(self, status):
        self.status = status


def words(status):
    return "   ".join(text for text, _ in status_parts(status))


def test_parts_of_the_status():
    assert [text for text, bad in status_parts(WELL) if bad] == []
    assert [text for text, bad in status_parts(BAD) if bad] == [
        *("no samples", "gaps 1", "lost 3", "dropped 4", "index late packet_gap")
    ]


def test_without_a_terminal_a_line_at_intervals(monkeypatch, capsys):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with StatusLine(Still(WELL)) as shown:
        shown.print("begun")
        for second in range(25):
            now[0] = 100.0 + second
            shown.update()
    assert capsys.readouterr().err.splitlines() == ["begun", words(WELL), words(WELL)]


@pytest.mark.parametrize(("colours", "red"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_on_a_terminal_it_is_rewritten_in_place(colours, red, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in ({"TERM": "xterm", "COLUMNS": "200"} | colours).items():
        monkeypatch.setenv(name, value)
    with StatusLine(Still(BAD)) as shown:
        shown.print("[bold]begun")
        shown.update()
        drawn = terminal.getvalue()
        shown.update()  # too soon
        assert terminal.getvalue() == drawn
    printed = terminal.getvalue()
    assert "[bold]begun" in printed
    assert printed.count("no samples") == 2  # and once more at the end
    assert printed.endswith("\x1b[2K")  # then it goes
    assert ("31m" in printed) is red
