"""Summary of a study: its main results in sentences, from the rows of its tables."""

from collections.abc import Iterable, Iterator

from holdfast_lab.report.result_tables import ResultTable, Row

CLASSIFIERS = ("LogReg", "SVM")
STRONGEST = {
    "on": "unseen objects",
    "error": "samples of hands [%]",
    "left out": "nothing",
    "baseline of": "all other methods",
}
"""Keys of the comparison with the strongest baseline that the summary reports."""
EVENTS = {"on": "unseen objects", "threshold": "for 1/min", "a glitch is": "an event"}
"""Keys of the events that the summary reports."""
SUMMARY_METHODS = (
    "holdfast",
    "LogReg (the paper)",
    "Linear SVM (the paper)",
    "PR2 slip servo (Romano 2011)",
    "Linear SVM, global (James & Lepora)",
)


def summary_text(tables: Iterable[ResultTable]) -> str:
    """Return the main results as a list, with a line for each that the tables have."""
    rows = {table.name: table.rows for table in tables}
    lines = [
        *accuracy_lines(rows.get("confusion", [])),
        *strongest_lines(rows.get("strongest", [])),
        *event_lines(rows.get("events", [])),
    ]
    return "\n".join(f"- {line}" for line in lines)


def accuracy_lines(rows: list[Row]) -> Iterator[str]:
    """Yield a sentence on the accuracy by each protocol."""
    for on, words in (
        ("held out", "The paper's protocol (samples split at random)"),
        ("other objects", "The same classifiers on objects that were not in training"),
    ):
        accuracies = [
            (name, row)
            for name in CLASSIFIERS
            for row in _select(rows, {"classifier": name, "on": on, "figure": "accuracy"})
        ]
        if accuracies:
            parts = []
            for name, row in accuracies:
                known = on == "held out" and row.paper is not None  # it tested no other objects
                paper = f" (paper: {row.paper:.1f} %)" if known else ""
                parts.append(f"{name} {_value(row)} % correct{paper}")
            yield f"{words}: {', '.join(parts)}{_recordings(accuracies[0][1])}."


def strongest_lines(rows: list[Row]) -> Iterator[str]:
    """Yield a sentence on our method and the strongest baseline."""
    ours = _select(rows, {**STRONGEST, "figure": "holdfast [%]"})
    baseline = _select(rows, {**STRONGEST, "figure": "baseline [%]"})
    # Without a baseline there is nothing to compare.
    for mine, other in zip(ours, baseline, strict=False):
        yield (
            f"On unseen objects our own method has {_value(mine)} % errors by samples of hands, "
            f"the strongest rival ({other.keys['baseline']}) {_value(other)} %{_recordings(mine)}."
        )


def event_lines(rows: list[Row]) -> Iterator[str]:
    """Yield a sentence on the missed events of some methods."""
    parts = [
        f"{method} {_value(missed)} % (with {_value(false)} false alarms per minute)"
        for method in SUMMARY_METHODS
        for missed in _select(rows, EVENTS | {"method": method, "figure": "missed at 100 ms [%]"})
        for false in _select(rows, EVENTS | {"method": method, "figure": "false alarms per minute"})
    ]
    if parts:
        yield (
            f"Events on unseen objects that are missed within 0.1 s: {', '.join(parts)}, at "
            "thresholds for 1 in training."
        )


def _select(rows: list[Row], keys: dict[str, str]) -> list[Row]:
    return [row for row in rows if keys.items() <= row.keys.items() and row.ours is not None]


def _value(row: Row) -> str:
    return f"{row.ours:.1f}"


def _recordings(row: Row) -> str:
    return "" if row.n is None else f"; {row.n} recordings"
