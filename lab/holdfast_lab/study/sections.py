"""Sections of the report in reading order, each with a text on how to read it; and its summary.

The summary has the main results in sentences, from the rows of the tables.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeVar

import msgspec

from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.sections import SUMMARY, ReportFigure, Section, join_lines

E = TypeVar("E", ResultTable, ReportFigure)


class SectionOutline(NamedTuple):
    """A section before its tables and figures are made.

    Attributes:
        title: of one line.
        text: how to read the section, in paragraphs.
        part: of the study whose tables and figures belong here, unless an outline names them.
        names: of tables and figures of any part that belong here; they come first.
    """

    title: str
    text: str
    part: str = ""
    names: tuple[str, ...] = ()


class PartOutput(NamedTuple):
    """Tables and figures of one part of the study."""

    tables: Sequence[ResultTable]
    figures: Sequence[ReportFigure]


TWIN_NOTE = (
    "These recordings are simulated: skin, friction and operator are models. The values compare "
    "methods; they do not predict how well a method works on a real hand."
)
"""Note of every table that is made from recordings of the twin."""

READ_ON = (
    "Every value has its interval and its number of recordings in its table; differences smaller "
    "than the intervals may be chance."
)
"""End of the summary."""

OUTLINES = (
    SectionOutline(
        "The paper's tables",
        """Each cell holds our value. Below it, in small print, are its 95 % interval and, if the
paper prints one, the paper's value with the difference (ours minus the paper's). Values are
percentages of labelled samples. Stable (1) is the positive class.

The paper splits samples at random. Nearly identical samples of one recording are then on both
sides of the split. Here each line names the data on which a classifier was tested. "Training
data" are the samples of the fit itself. "Cross-validated" and "held out" are other samples of the
same recordings. Only "fresh recordings" (or "other recordings") and "other objects" are new data,
as in actual use. Read those lines first.

- FPR: fraction of the unstable samples that are called stable (missed dangers).
- FNR: fraction of the stable samples that are called unstable (needless alarms).
- FDR: fraction of the samples called stable that are not stable.
- N_w: number of samples in the window of the features; at 150 Hz, 14 samples are 93 ms.""",
        "paper",
        ("confusion", "window", "ablation", "zhang", "fingers"),
    ),
    SectionOutline(
        "The paper's figures",
        """Each figure shows one finger in one recording. The shades are the phases of the
experiment, if the recording has them. A recording is chosen by what was done in it and by its
name, not by the look of its figure. Recordings that were not used for training are preferred.
If no recording is of a failed grasp, the figure of experiment 1 is missing.""",
        "experiments",
    ),
    SectionOutline(
        "The paper's experiments in numbers",
        """The paper shows experiments 1 and 2 as one picture each. Here they are counted over all
recordings, by fits that did not use them. Experiment 1: how much of a failed grasp is called
unstable. Experiment 2: the time from the lock to the first stable estimate, and which
disturbances are detected. The last table lists single disturbances.""",
        "experiment tables",
        ("experiment_1", "experiment_2", "experiment_phases", "disturbances"),
    ),
    SectionOutline(
        "Where the paper disagrees with itself",
        """Lines with the same subject are statements of the paper about one thing. They
contradict each other, or they leave open what a repetition needs. For this reason some tables
are given twice in this report, and a difference to one printed value means little.""",
        "",
        ("discrepancies",),
    ),
    SectionOutline(
        "Results on new data",
        """The same classifiers on new recordings, on other objects, and out of fold. With a random
split the accuracy is higher; the difference shows how much a random split overestimates it. Quote
the values of new data.""",
        "",
        ("unseen", "splits"),
    ),
    SectionOutline(
        "Methods compared",
        """Every method is fitted to the same recordings and evaluated on the same other
recordings, for each finger or for the whole hand. Differences to the paper's method are paired by
recording. If the interval of a difference does not contain zero, one of the two methods is better
on these data, even if the intervals of the two methods overlap. A method for fingers and a method
for the whole hand solve different tasks. The table of hands evaluates all of them on the same
task.""",
        "comparison",
        ("strongest", "methods", "hands"),
    ),
    SectionOutline(
        "Events: detection delay and false alarms",
        """A user does not see samples but events: an object that was held begins to move. "Missed
at 50 ms" is the fraction of events without an alarm 50 ms after the onset. The delay counts from
the onset, and is infinite for an event that was never detected. False alarms are counted per
minute of undisturbed hold. A threshold with fewer missed events has more false alarms, so compare
methods at similar rates of false alarms. All thresholds are chosen on training recordings
only.""",
        "",
        ("events", "glitches", "alarms"),
    ),
    SectionOutline(
        "Slips of fingers",
        """Slip is a second question beside stability: does this finger slide over its object? Every
method is fitted to true sliding, sample by sample, and its decisions are scored as slips. Early
alarms count as found, and a decision that stays raised gains nothing. Compare "within 100 ms" and
"before 1 mm", at rates of false alarms that are alike.""",
        "slips",
    ),
    SectionOutline(
        "Models that ship",
        """builtin:any was trained on drawn hands of which the hand of this study is none,
builtin:twin on other grasps of it. A taught model is builtin:any with a slip rule from a few grasps
of this hand, whose slips are the true ones; a camera sees fewer. Until it is taught, builtin:any
reports no slip. The last line of each group does nothing.""",
        "shipped",
        ("models", "slip_speeds"),
    ),
    SectionOutline(
        "Probabilities",
        """Whether of 100 samples with a probability of 0.8 about 80 are stable. The Brier score is
the mean squared error of the probability; 0 is best.""",
        "",
        ("reliability",),
    ),
    SectionOutline(
        "Real recordings",
        """The model that ships, builtin:any, was trained on the twin only. It is evaluated on
recordings of a real hand, as it ships and adapted to the other recordings. The methods are trained
on the other recordings of the same hand, which gives them an advantage. Look at each recording:
the pooled values of a few recordings say little. No value here is the accuracy on your hand.""",
        "real",
    ),
)  # fmt: skip

LIMITS_TEXT = """\
These results come from recordings of a simulated hand. The simulation was not tuned to
make the results better. It cannot show:

- how good a method is on a given real hand: tremor, stiffness of the operator, texture and
friction are plausible guesses that are not fitted to measurements;
- the material between taxels and object: each node of the skin is a separate spring, without
lateral coupling and torsion, and friction does not grow while an object is held;
- defects of a real skin: dead taxels, magnetic disturbance by metal, irregular time stamps;
- mechanics and wear of a hand: there is no play in gears and there are no cables, and only the
fingertips touch the object;
- how a person labels: these labels are computed from the true outside force, while a person is
late and misses slips of a tenth of a millimetre;
- the share of idle time: in about three of ten samples the hand is empty, and those are classified
without error. More idle time gives a higher accuracy, not a better detector: look at phases and
events."""


def report_sections(
    outputs: Mapping[str, PartOutput],
    run_notes: Sequence[str],
    sources: Sequence[str],
    *,
    twin: bool,
) -> list[Section]:
    """Return the sections of the report: summary, run, results, limits of the twin.

    Args:
        outputs: tables and figures, by part.
        run_notes: sentences on what was run and what was left out.
        sources: of the methods, and what differs from them here.
        twin: whether the recordings, except the real ones, are of the twin.
    """
    summary = summary_text(table for output in outputs.values() for table in output.tables)
    sections = [Section(SUMMARY, f"{summary}\n\n{READ_ON}")] if summary else []
    sections.append(Section("What was run", "\n".join(f"- {note}" for note in run_notes)))
    tables_by_part = {part: output.tables for part, output in outputs.items()}
    figures_by_part = {part: output.figures for part, output in outputs.items()}
    for outline in OUTLINES:
        tables = _select(outline, tables_by_part)
        figures = _select(outline, figures_by_part)
        if tables or figures:
            if twin:
                # Not where no recording was evaluated, as in the table of the paper's statements.
                tables = [
                    msgspec.structs.replace(table, note=f"{table.note} {TWIN_NOTE}".strip())
                    if outline.part != "real" and any(row.n for row in table.rows)
                    else table
                    for table in tables
                ]
            sections.append(Section(outline.title, join_lines(outline.text), tables, figures))
    sections.append(Section("Methods", "\n".join(f"- {source}" for source in sources)))
    if twin:
        sections.append(Section("What the twin cannot show", join_lines(LIMITS_TEXT)))
    return sections


def _select(outline: SectionOutline, by_part: Mapping[str, Sequence[E]]) -> list[E]:
    """Return what an outline names, in that order, then the rest of its part."""
    every = {each.name: each for part in by_part.values() for each in part}
    named = [every[name] for name in outline.names if name in every]
    return named + [each for each in by_part.get(outline.part, ()) if each.name not in _NAMED]


_NAMED = frozenset(name for outline in OUTLINES for name in outline.names)


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
            for row in _matching(rows, {"classifier": name, "on": on, "figure": "accuracy"})
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
    ours = _matching(rows, {**STRONGEST, "figure": "holdfast [%]"})
    baseline = _matching(rows, {**STRONGEST, "figure": "baseline [%]"})
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
        for missed in _matching(rows, EVENTS | {"method": method, "figure": "missed at 100 ms [%]"})
        for false in _matching(
            rows, EVENTS | {"method": method, "figure": "false alarms per minute"}
        )
    ]
    if parts:
        yield (
            f"Events on unseen objects that are missed within 0.1 s: {', '.join(parts)}, at "
            "thresholds for 1 in training."
        )


def _matching(rows: list[Row], keys: dict[str, str]) -> list[Row]:
    return [row for row in rows if keys.items() <= row.keys.items() and row.ours is not None]


def _value(row: Row) -> str:
    return f"{row.ours:.1f}"


def _recordings(row: Row) -> str:
    return "" if row.n is None else f"; {row.n} recordings"
