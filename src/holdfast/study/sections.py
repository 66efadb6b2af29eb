"""The report's chapters in a reader's order, with words on how to read each."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import msgspec

from holdfast.study.report.html_report import ReportFigure, Section
from holdfast.study.report.result_tables import ResultTable

E = TypeVar("E", ResultTable, ReportFigure)


class Chapter(NamedTuple):
    """A section before its tables and figures are there.

    Attributes:
        title: of one line.
        text: how to read it, in paragraphs.
        part: of the study, whose tables and figures come here unless another chapter names them.
        names: of tables and figures that come here whatever their part, with those first.
    """

    title: str
    text: str
    part: str = ""
    names: tuple[str, ...] = ()


TWIN = (
    "Of the physical twin: skin, friction and operator are models, so this compares methods; it "
    "does not foretell figures on a real hand."
)
"""Stands beside every table that rests on the twin."""

CHAPTERS = (
    Chapter(
        "The paper's tables",
        """Each cell holds our figure; in small print its 95 % interval and, where the paper prints
one, the paper's figure with the difference, ours less the paper's. Percent, of labelled samples;
1 = stable is the positive class.

The paper splits samples at random, so that nearly the same sample stands on both sides of the
split. What it mixes is kept apart here, line by line: "training data" is what the fit itself saw,
"cross-validated" and "held out" are samples of the same recordings, and only "fresh recordings"
(or "other recordings") and "other objects" are what a user of the classifier will meet. Read the
last lines first.

- FPR: of what is not stable, how much is called stable: a danger missed.
- FNR: of what is stable, how much is called unstable: a needless alarm.
- FDR: of what is called stable, how much is not.
- N_w: samples in the window of the features; at 150 Hz 14 samples are 93 ms.""",
        "paper",
        ("confusion", "window", "ablation", "zhang", "fingers"),
    ),
    Chapter(
        "The paper's figures",
        """One finger over single recordings. Shades are what was going on, where the recordings
say it. Recordings are chosen by what was done in them and by their names, before anybody saw the
figure; where there are recordings that did not train, those are taken.
Where no recording is of a failed grasp, experiment 1 is missing.""",
        "experiments",
    ),
    Chapter(
        "Where the paper disagrees with itself",
        """Lines of one subject are statements of the paper about one thing that cannot all be
true, or that leave open what a repetition needs. They are the reason why some tables stand here
twice, and why a difference to one printed figure means little.""",
        "",
        ("discrepancies",),
    ),
    Chapter(
        "On data that training never saw",
        """The same classifiers on recordings made anew, on other objects, and out of fold. The
distance between a random split and these lines is what a random split flatters; it is the figure
to quote.""",
        "",
        ("unseen", "splits"),
    ),
    Chapter(
        "Methods compared",
        """Every method is fitted to the same recordings and judged on the same other ones, finger
by finger or as a whole hand. Differences to the paper's method are paired, recording by
recording: an interval that does not hold zero means that the one is better on these data, however
wide the intervals of each alone are. A method that judges fingers and one that judges the whole
hand do not have the same task: as hands all are compared.""",
        "comparison",
        ("methods", "hands", "cost"),
    ),
    Chapter(
        "Events: how late, how often in vain",
        """A user does not meet samples but events: a held object begins to move. "Missed at 50 ms"
is the share of events without an alarm 50 ms after the onset; a delay counts from the onset, and
one that was never found counts as infinite. False alarms are counted per minute of undisturbed
hold. Each trades against the other by the threshold, so compare methods where their false alarms
are alike: thresholds are chosen on training recordings alone.""",
        "",
        ("events", "slips", "alarms"),
    ),
    Chapter(
        "Where the errors are",
        """The same decisions, taken apart: by what was going on, by how strong the grip was, by
the direction of the push, and by whether a probability of 0.8 is right in 80 of 100 cases (the
Brier score is the mean squared error of the probability; 0 is best). These are the claims that the
paper makes and does not test.""",
        "",
        ("phases", "force", "grip", "directions", "reliability"),
    ),
    Chapter(
        "Sensitivity",
        """What happens when one thing is changed: noise on the readings, the margin by which
labels are drawn longer, the profile of the twin (how hard it grips and how it is disturbed), the
sampling rate. A method whose curve falls early is a method to distrust on another hand.""",
        "sensitivity",
    ),
    Chapter(
        "Real recordings",
        """Five short recordings of one box, held by two flat uSkin patches of a gripper (Nazari,
Mandil and Ghalamzan, CoRL 2022). Slip happens in two of them, and in those the arm also moves
faster: slip and speed cannot be told apart. The box is already held at the first sample, so that
there is no stretch without contact. Look at each recording and at its AUC, and take no single
figure as the accuracy on real data.""",
        "real",
    ),
)  # fmt: skip

LIMITS = """These figures rest on recordings of a simulated hand. It is fixed, and was not tuned
until figures came out right; yet it cannot show:

- how good a method is on a given real hand: tremor, stiffness of the operator, texture and
friction are plausible guesses, fitted to nothing;
- what lies between taxels and object: each node of the skin is a spring of its own, without
sideways coupling or torsion, and friction does not grow while an object is held;
- the skin's real flaws: dead taxels, magnetic disturbance by metal, unsteady stamps;
- how hands wear: no play in gears, no cables; only the fingertips touch;
- how a person labels: labels here know the true outside force; a person is late and misses slips
of a tenth of a millimetre;
- the idle hand: about three in ten samples have nothing in the hand and are told without error.
More idle time makes a better accuracy, not a better detector: look at phases and events."""


class Made(NamedTuple):
    """What one part of the study made."""

    tables: Sequence[ResultTable]
    pictures: Sequence[ReportFigure]


def sections(made: Mapping[str, Made], run: Sequence[str], *, twin: bool) -> list[Section]:
    """The sections of the report: what was run, the chapters that hold anything, the limits.

    Args:
        made: by part.
        run: what was run and what was left out, in sentences.
        twin: whether the recordings, but for the real ones, are of the twin.
    """
    found = [Section("What was run", "\n".join(f"- {each}" for each in run))]
    tables_of = {part: one.tables for part, one in made.items()}
    pictures_of = {part: one.pictures for part, one in made.items()}
    for chapter in CHAPTERS:
        tables = _own(chapter, tables_of)
        pictures = _own(chapter, pictures_of)
        if tables or pictures:
            marked = [_marked(table, chapter) if twin else table for table in tables]
            found.append(Section(chapter.title, _filled(chapter.text), marked, pictures))
    if twin:
        found.append(Section("What the twin cannot show", _filled(LIMITS)))
    return found


def _own(chapter: Chapter, by_part: Mapping[str, Sequence[E]]) -> list[E]:
    """What belongs to a chapter: what it names, in that order, then the rest of its part."""
    every = {each.name: each for part in by_part.values() for each in part}
    named = [every[name] for name in chapter.names if name in every]
    named += [each for each in by_part.get(chapter.part, ()) if each.name not in _NAMED]
    return named


_NAMED = frozenset(name for chapter in CHAPTERS for name in chapter.names)


def _marked(table: ResultTable, chapter: Chapter) -> ResultTable:
    """The table with a word on the twin, where it rests on it."""
    if chapter.part == "real" or not any(row.n for row in table.rows):
        return table
    return msgspec.structs.replace(table, note=f"{table.note} {TWIN}".strip())


def _filled(text: str) -> str:
    """Paragraphs whose lines are joined; each item of a list on one line."""
    return "\n\n".join(_joined(paragraph.splitlines()) for paragraph in text.split("\n\n"))


def _joined(lines: Iterable[str]) -> str:
    """One line, or one for each item of a list."""
    return "".join(f"\n{line}" if line.startswith("- ") else f" {line}" for line in lines).strip()
