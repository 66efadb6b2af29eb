import logging

from holdfast.web.connections import BriefLog


def record(line=1, text="broken", error=None):
    info = (type(error), error, error.__traceback__) if error else None
    return logging.LogRecord("x", logging.ERROR, "file.py", line, "%s\nhere", (text,), info)


def test_a_place_logs_one_line_and_not_again_at_once():
    brief = BriefLog()
    first, second, other = record(error=ValueError("bad\nthing")), record(), record(line=2)
    assert [brief.filter(one) for one in (first, second, other)] == [True, False, True]
    assert logging.Formatter().format(first) == "broken here: ValueError('bad\\nthing')"


def test_the_whole_log_for_debugging(monkeypatch):
    monkeypatch.setenv("HOLDFAST_DEBUG", "1")
    brief, one = BriefLog(), record(error=ValueError("bad"))
    assert brief.filter(one)
    assert brief.filter(one)
    assert one.exc_info is not None
