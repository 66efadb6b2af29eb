"""Sections of the report in reading order, each with its tables and figures."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import msgspec

from holdfast_lab.report.result_tables import ResultTable
from holdfast_lab.report.sections import ReportFigure, Section

E = TypeVar("E", ResultTable, ReportFigure)


class SectionOutline(NamedTuple):
    """A section before its tables and figures are made.

    Attributes:
        title: of one line.
        part: of the study whose tables and figures belong here, unless an outline names them.
        names: of tables and figures of any part that belong here; they come first.
    """

    title: str
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

OUTLINES = (
    SectionOutline(
        "The paper's tables", "paper", ("confusion", "window", "ablation", "zhang", "fingers")
    ),
    SectionOutline("The paper's figures", "experiments"),
    SectionOutline(
        "The paper's experiments in numbers",
        "experiment tables",
        ("experiment_1", "experiment_2", "experiment_phases", "disturbances"),
    ),
    SectionOutline("Where the paper disagrees with itself", "", ("discrepancies",)),
    SectionOutline("Results on new data", "", ("unseen", "splits")),
    SectionOutline("Methods compared", "comparison", ("strongest", "methods", "hands")),
    SectionOutline(
        "Events: detection delay and false alarms", "", ("events", "glitches", "alarms")
    ),
    SectionOutline("Slips of fingers", "slips"),
    SectionOutline("Models that ship", "shipped", ("models", "slip_speeds")),
    SectionOutline("Probabilities", "", ("reliability",)),
    SectionOutline("Real recordings", "real"),
)


def report_sections(
    outputs: Mapping[str, PartOutput],
    run_notes: Sequence[str],
    sources: Sequence[str],
    *,
    twin: bool,
) -> list[Section]:
    """Return the sections of the report: the run, the results, the sources of the methods.

    Args:
        outputs: tables and figures, by part.
        run_notes: sentences on what was run and what was left out.
        sources: of the methods, and what differs from them here.
        twin: whether the recordings, except the real ones, are of the twin.
    """
    sections = [Section("What was run", "\n".join(f"- {note}" for note in run_notes))]
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
            sections.append(Section(outline.title, "", tables, figures))
    return [*sections, Section("Methods", "\n".join(f"- {source}" for source in sources))]


def _select(outline: SectionOutline, by_part: Mapping[str, Sequence[E]]) -> list[E]:
    """Return what an outline names, in that order, then the rest of its part."""
    every = {section.name: section for part in by_part.values() for section in part}
    named = [every[name] for name in outline.names if name in every]
    return named + [
        section for section in by_part.get(outline.part, ()) if section.name not in _NAMED
    ]


_NAMED = frozenset(name for outline in OUTLINES for name in outline.names)
