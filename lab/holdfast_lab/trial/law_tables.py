"""Tables of a comparison of laws, from the contents of `trial.json`."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.trial.run import DROP_REASONS
from holdfast_lab.trial.summary import Summary

By = Mapping[str, Summary]
"""Summaries or comparisons by law."""


class LawColumn(NamedTuple):
    """Column of a table of laws.

    Attributes:
        head: head of the column, with its unit.
        field: name of the number in `trial.json`.
        factor: factor of the number.
        digits: after the decimal point.
        n_field: number without which there is no value; with it, a missing value is infinite.
    """

    head: str
    field: str
    factor: float = 1.0
    digits: int = 1
    n_field: str = ""


NUMBER_COLUMNS = (
    LawColumn("dropped [%]", "dropped"),
    LawColumn("slip [mm]", "slip_median", 1e3, 2, "n"),
    LawColumn("reaction [ms]", "reaction_median", 1e3, 0, "n_reacting"),
    LawColumn("force / least", "force_ratio_mean", digits=2),
    LawColumn("false reactions per minute", "false_reactions_per_minute"),
)
"""Numbers of a law."""
SLIP_COLUMNS = (
    LawColumn("slip, 75 % below [mm]", "slip_p75", 1e3, 1, "n"),
    LawColumn("90 % below [mm]", "slip_p90", 1e3, 1, "n"),
    LawColumn("over 3 mm [%]", "slipped_over_3mm"),
    LawColumn(
        "reaction when friction falls [ms]",
        "friction_reaction_median",
        1e3,
        0,
        "n_friction_reacting",
    ),
)
"""Numbers of a law on long slips and on friction that falls."""
FORCE_COLUMNS = (
    LawColumn("force / least that stops", "force_ratio_mean", digits=2),
    LawColumn("force / least that holds", "static_ratio_mean", digits=2),
    LawColumn("force / least by Coulomb", "coulomb_ratio_mean", digits=2),
    LawColumn("peak / least peak", "peak_ratio_mean", digits=2),
)
"""Numbers of a law on force, over three least forces."""
DIFFERENCES = (
    LawColumn("dropped [points]", "dropped"),
    LawColumn("slid less in [%]", "slid_less", digits=0),
    LawColumn("slid more in [%]", "slid_more", digits=0),
    LawColumn("reacted sooner in [%]", "reacted_sooner", digits=0),
    LawColumn("reacted later in [%]", "reacted_later", digits=0),
    LawColumn("force / least", "force_ratio_mean", digits=2),
    LawColumn("false reactions per minute", "false_reactions_per_minute"),
)
"""Paired differences of a law to another."""
ALL_COLUMNS = (*NUMBER_COLUMNS, *SLIP_COLUMNS, *FORCE_COLUMNS, *DIFFERENCES)
SHORT = NUMBER_COLUMNS[:4]
"""Numbers in tables of parts of the trials."""


def law_tables(document: Mapping[str, Any]) -> list[ResultTable]:
    """Return the tables of all laws over all trials.

    The document of an older run has the first of them only.
    """
    tables = (laws_table, slips_table, forces_table, drops_table)
    has_all = all("drops" in summary for summary in document["laws"].values())
    return [table(document) for table in (tables if has_all else tables[:1])]


def laws_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of all laws over all trials."""
    return _table(
        "laws",
        "Laws of grip force on the same trials",
        "Medians of slip and reaction; a drop counts as infinite in both.",
        _rows(document["laws"], NUMBER_COLUMNS),
    )


def slips_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of long slips, and of the reaction to friction that falls."""
    note = "A drop counts as infinite, and so does no reaction."
    rows = _rows(document["laws"], SLIP_COLUMNS)
    return _table("slips", "Long slips, and friction that falls", note, rows)


def forces_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of force over each least force."""
    note = (
        "Least forces by linear programming with the contacts before the load: with kinetic "
        "friction (stops a slide), with static friction (holds without one); and by Coulomb "
        "friction at rest without contacts and moments. Peak: over the least that stops."
    )
    return _table("forces", "Force over the least", note, _rows(document["laws"], FORCE_COLUMNS))


def drops_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of drops by reason."""
    rows = [
        Row({"law": law, "figure": reason}, summary["drops"].get(reason, 0), None, summary["n"])
        for law, summary in document["laws"].items()
        for reason in DROP_REASONS
    ]
    return _table("drops", "Number of drops by reason", "", iter(rows))


def objects_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of all laws by set of objects."""
    parts = {"the six": document["seen_objects"], "six others": document["unseen_objects"]}
    return _table(
        "objects",
        "By set of objects",
        "The model builtin:twin was trained on the six, and on none of the six others.",
        _rows_of_parts(parts, "objects", NUMBER_COLUMNS),
        "objects",
    )


def paired_table(document: Mapping[str, Any], other: str) -> ResultTable:
    """Return the table of paired differences of all other laws to one."""
    return _table(
        f"paired-{other}",
        f"Each law minus {other}, on the same trials",
        "Differences of pairs: each resample of the bootstrap draws the same trials for both "
        "laws. Two drops count as equal slip and equal reaction.",
        _rows(document["paired"][other], DIFFERENCES),
    )


def kinds_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of all laws by kind of load."""
    rows = _rows_of_parts(document["by_kind"], "load", SHORT)
    return _table("kinds", "By kind of load", "", rows, "load")


def fingers_table(document: Mapping[str, Any]) -> ResultTable:
    """Return the table of all laws by number of fingers."""
    rows = _rows_of_parts(document["by_fingers"], "fingers", SHORT)
    return _table("fingers", "By number of fingers of the grip", "", rows, "fingers")


def _table(name: str, title: str, note: str, rows: Iterator[Row], *lines: str) -> ResultTable:
    return ResultTable(
        name, title, note, list(rows), (*lines, "law"),
        digits_of={column.head: column.digits for column in ALL_COLUMNS},
        counted="trials", has_paper=False,
    )  # fmt: skip


def _rows_of_parts(
    parts: Mapping[str, By], key: str, columns: tuple[LawColumn, ...]
) -> Iterator[Row]:
    for part, by_law in parts.items():
        if any(summary["n"] for summary in by_law.values()):
            yield from _rows(by_law, columns, {key: part})


def _rows(
    by_law: By, columns: tuple[LawColumn, ...], keys: Mapping[str, Key] | None = None
) -> Iterator[Row]:
    for law, summary in by_law.items():
        for column in columns:
            # JSON has null for what is infinite and for what is not known; the number of trials
            # behind a value tells them apart. The document of an older run has `n_slipped` alone.
            n = summary.get(column.n_field, summary.get("n_slipped", 0)) if column.n_field else 0
            number = summary[column.field]
            value, *ends = (
                (math.inf if n else None) if bound is None else column.factor * bound
                for bound in (number["value"], *(number["interval"] or ()))
            )
            yield Row(
                {**(keys or {}), "law": law, "figure": column.head}, value, None, summary["n"],
                (ends[0], ends[1]) if ends else None,
            )  # fmt: skip
