"""Report of a comparison of laws: its sections, and its main results in sentences."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from holdfast_lab.report.result_tables import number_text
from holdfast_lab.report.sections import SUMMARY, ReportFigure, Section, join_lines
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.document import BASELINE_LAW, OWN_LAW, TrialResults
from holdfast_lab.trial.figures import (
    course_figure,
    distribution_figure,
    kinds_figure,
    trade_off_figure,
)
from holdfast_lab.trial.summary import Summary
from holdfast_lab.trial.tables import (
    ALL_COLUMNS,
    NUMBER_COLUMNS,
    LawColumn,
    fingers_table,
    kinds_table,
    law_tables,
    objects_table,
    paired_table,
)

WHAT = """Each law of grip force runs on the same trials of the twin. In a trial the hand grips an
object lightly, the operator lets go, and after 2.5 to 3.5 s a load comes: added weight, a pull in
any of six directions, friction that drops, a shake, or a fast transport. Objects, loads and grips
follow from the seed. The set of trials and the first grip, {grip:g} times the least force of the
unloaded object, were fixed before any law but "fixed" ran on them. docs/grip.md names the source
of each law and of its constants."""
MEANINGS = """- Dropped: lost after the load or the loop began. Trials whose object was lost before
both are left out of everything; trial.json counts them in n_not_held.
- Slip: the largest distance that a fingertip slid after the loop began. A drop counts as infinite.
- Reaction: time from the first sample at which a fingertip slides faster than 1 mm/s under the load
to the next command that is 2 % higher. If the force had already risen since the load came, nothing
reacted to that slip, and the trial has no reaction time; trial.json counts it in n_raised_before.
No reaction counts as infinite, and so does a drop. The command acts one sample (6.7 ms) later.
- Force / least: mean normal force over the mean of the least force that stops a slide, at each
instant with its load, from the start of the loop until the end or the drop. The least force is
found by linear programming: forces and moments balance, with kinetic friction, at the contacts
right before the load, which are those of the first grip for every law. The friction cones are
pyramids of 16 edges inside them, so it is at most 2 % too high. Trials in which no force can stop
a slide for 0.1 s are left out for every law, and trial.json names them.
- Drops by reason: the loop never began, a finger was at the highest scale, or neither (slip).
- False reactions: rises of force in the quiet hold before the load, per minute, each of them, also
those that follow another at once. The hold is not quiet for 0.3 s after a fingertip slid, as it
does when the controller of the hand jerks, and for 0.3 s after the loop began.
- fixed-1.5 and fixed-2 are constant forces. true-slips is the law of holdfast with the true slips
of the twin; true-load-1.5 and true-load-2 press by this multiple of the least force that holds.
v5-reflex is the reflex of the driver of the V5: the force doubles once. Rows that end in -widest
have force scales from 0.5 to 5 in place of the limits as shipped.
- Plant: {plant}.
- Intervals: 95 %, by bootstrap over trials. All laws share the resamples. Where none of n trials
was dropped the interval is 0 to 0, but a true share of up to about 3 in n is still plausible."""
LIMITS_OF_TWIN = """These are results of a simulation. Its parameters have physical grounds and were
not turned to make a law look good. It cannot show:

- what a real hand adds: heat, wear, torque limits. Backlash, friction in the joints, latency and
the lag of the motors are those of the plant, whose numbers are argued and not measured;
- objects that yield, break or are damaged by a high force: a high force costs nothing here but the
column with the force;
- friction as of real surfaces: here it is Coulomb friction with one coefficient for an object. It
does not grow with time, and does not depend on the load, on moisture or on the speed;
- a real skin: each node is a separate spring, without lateral coupling and without drift by heat,
and no taxel is dead;
- other grips: all trials have the same hand in the same precision grip with three or four fingers,
at two times the least force. A power grip behaves otherwise;
- what people do: the loads are drawn from stated ranges, and come one at a time."""


class Example(NamedTuple):
    """The trial that is shown.

    Attributes:
        what: sentence that describes the trial.
        courses: its course by law.
    """

    what: str
    courses: Mapping[str, TrialCourse]


def report_sections(
    document: Mapping[str, Any], results: TrialResults, example: Example | None
) -> list[Section]:
    """Return the sections of the report; the summary is the first.

    Args:
        document: contents of `trial.json`.
        results: of all trials, by law.
        example: the trial that is shown, if there is one.
    """
    paired = [paired_table(document, other) for other in document["paired"]]
    text = join_lines(WHAT.format(grip=document["first_grip"]))
    return [
        Section(SUMMARY, summary_text(document)),
        Section("One trial, lost and saved", *_example(example)),
        Section("All laws", text, law_tables(document), [trade_off_figure(document)]),
        Section("In pairs", PAIRED, [table for table in paired if table.rows]),
        Section("Slip and reaction", "", [], [distribution_figure(results)]),
        Section(
            "Kinds of load, objects and fingers",
            "",
            [kinds_table(document), objects_table(document), fingers_table(document)],
            [kinds_figure(document)],
        ),
        Section("What the numbers mean", join_lines(MEANINGS.format(plant=_plant(document)))),
        Section("What the twin cannot show", join_lines(LIMITS_OF_TWIN)),
    ]


PAIRED = (
    "The trials differ more than the laws do, so each law is compared with another on the same "
    "trials. A value below 0 means that the law of the line has less."
)


def _plant(document: Mapping[str, Any]) -> str:
    """Return the plant with its numbers."""
    plant = document["plant"]
    shortest, longest = plant["latency"]
    rate = plant["jerk_rate"]
    jerks = "7 jerks a minute" if rate is None else f"{60 * rate:.0f} jerks a minute"
    return (
        f"{plant['name']}: latency of sensor and bus {shortest} to {longest} samples of 6.7 ms, "
        f"lag of the motors {1e3 * plant['motor_time']:g} ms, friction of a joint "
        f"{plant['joint_friction']:g} N m, backlash {plant['backlash']:g} rad, {jerks} of "
        f"{plant['jerk_size']:g} rad"
    )


def summary_text(document: Mapping[str, Any]) -> str:
    """Return the main results: one sentence on all, then the goals, as a list."""
    laws = document["laws"]
    law = OWN_LAW if OWN_LAW in laws else next(iter(laws))
    dropped = NUMBER_COLUMNS[0]
    parts = [f"{law} dropped {_text(laws[law], dropped)} % of the objects"]
    if BASELINE_LAW in laws and law != BASELINE_LAW:
        parts.append(f"a grip of fixed force {_text(laws[BASELINE_LAW], dropped)} %")
    lines = [
        f"On {laws[law]['n']} trials of the twin, {', '.join(parts)}.",
        *_goals(laws[law], law, document["unseen_objects"][law], document["goals"]),
    ]
    return "\n".join(f"- {line}" for line in lines)


def _goals(row: Summary, law: str, unseen: Summary, goals: Mapping[str, float]) -> Iterator[str]:
    """Yield a sentence for each number that has a goal."""
    columns = {column.field: column for column in reversed(ALL_COLUMNS)}
    for column in (columns[field] for field in goals):
        value, goal = row[column.field]["value"], goals[column.field]
        missing = value is None and bool(column.n_field and not row.get(column.n_field))
        # A missing value of trials that did react is infinite: the goal is missed.
        reached = value is not None and value <= goal
        verdict = "nothing slipped" if missing else "reached" if reached else "missed"
        yield (
            f"{column.head}: {_text(row, column)} for {law}, on the six other objects "
            f"{_text(unseen, column)}; the goal is at most {column.factor * goal:g}: {verdict}."
        )


def _text(row: Summary, column: LawColumn) -> str:
    """Return a number with its interval."""
    number = row[column.field]
    if number["value"] is None:
        return "infinite" if column.n_field and row[column.n_field] else "not known"
    ends = [None if end is None else column.factor * end for end in number["interval"] or ()]
    text = number_text(column.factor * number["value"], column.digits)
    if not ends:
        return text
    low, high = ("infinite" if end is None else number_text(end, column.digits) for end in ends)
    return f"{text} ({low} to {high})"


def _example(example: Example | None) -> tuple[str, list[Any], list[ReportFigure]]:
    """Return text, tables and figures of the section of the example."""
    rule = (
        "It is chosen by a rule: the first of the set that "
        f"{BASELINE_LAW} loses and {OWN_LAW} holds."
    )
    if example is None:
        return f"There is no such trial, or one of the laws was not run. {rule}", [], []
    return f"{example.what} {rule}", [], [course_figure(example.courses, example.what)]
