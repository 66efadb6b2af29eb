"""What a publication takes from a study: a text of its methods, and its references as BibTeX."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from holdfast.features import DEFAULT_WINDOW, DEPLOYED_FEATURES
from holdfast_lab.report.result_tables import ResultTable
from holdfast_lab.study.comparison.jobs import method_effort, method_titles
from holdfast_lab.study.environment import ROLES
from holdfast_lab.study.evaluation.evaluate_method import COMPARED_RATE, HOLD_TIME
from holdfast_lab.study.evaluation.evaluate_slips import SLIP_RATE
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.methods.learning import JAMES_LEPORA
from holdfast_lab.study.plan import StudyPlan

METHODS_FILE, REFERENCES_FILE = "methods.md", "references.bib"
"""Files beside the tables of a study."""
COMPARED_KEYS = frozenset({"method", "baseline", "measure"})
"""Keys of rows that name what is compared."""
CITED = {
    "zhang": "zhang2016",
    "slip_servo": "romano2011",
    "spectrum": "fernandez2014",
    "tangential": "wong2026",
    "anyskin": "bhirangi2024",
    **{method.name: "james2020" for method in JAMES_LEPORA},
    "tcn": "grover2022",
}
"""Entries of `REFERENCES` that methods come from, by the names of the methods."""

REFERENCES = r"""
@inproceedings{kitouni,
  author = {Kitouni, Dounia and Khoramshahi, Mahdi and Perdereau, Veronique},
  title = {A model-free approach to fingertip slip and disturbance detection for grasp
           stability inference},
}
@article{zhang2016,
  author = {Zhang and others},
  journal = {IEEE Sensors Journal},
  volume = {16},
  pages = {7073},
  year = {2016},
}
@article{romano2011,
  author = {Romano, Joseph M. and Hsiao, Kaijen and Niemeyer, G{\"u}nter and Chitta, Sachin and
            Kuchenbecker, Katherine J.},
  title = {Human-inspired robotic grasp control with tactile sensing},
  journal = {IEEE Transactions on Robotics},
  volume = {27},
  year = {2011},
}
@article{fernandez2014,
  author = {Fernandez, Raul and Payo, Ismael and Vazquez, Andres S. and Becedas, Jonathan},
  title = {Micro-vibration-based slip detection in tactile force sensors},
  journal = {Sensors},
  volume = {14},
  year = {2014},
}
@misc{bhirangi2024,
  author = {Bhirangi, Raunaq and others},
  title = {AnySkin: Plug-and-play skin sensing for robotic touch},
  eprint = {2409.08276},
  archiveprefix = {arXiv},
  year = {2024},
}
@misc{james2020,
  author = {James, Jasper W. and Lepora, Nathan F.},
  title = {Slip detection for grasp stabilisation with a multi-fingered tactile robot hand},
  eprint = {2010.01928},
  archiveprefix = {arXiv},
  year = {2020},
}
@inproceedings{grover2022,
  author = {Grover, Abhinav and Nadeau, Philippe and Grebe, Christopher and Kelly, Jonathan},
  title = {Learning to detect slip with barometric tactile sensors and a temporal convolutional
           neural network},
  booktitle = {IEEE International Conference on Robotics and Automation},
  year = {2022},
}
@article{wong2026,
  author = {Wong, Dickson Chiu Yu and Zhu, Zheng H.},
  title = {Calibration-free per-finger force-feedback slip control for grasping by
           anthropomorphic hand with tri-axial tactile sensors},
  journal = {Frontiers in Robotics and AI},
  doi = {10.3389/frobt.2026.1735467},
  year = {2026},
}
"""
"""Entries of publications. What is not known for certain is left out."""


def methods_text(plan: StudyPlan, summary: Mapping[str, Any], tables: Sequence[ResultTable]) -> str:
    """Return the protocol of a study as text for a publication.

    Args:
        plan: of the study.
        summary: contents of `study.json`, without the tables.
        tables: of the study.
    """
    source = (
        "simulated by the physical twin of holdfast [@holdfast]"
        if plan.main.is_simulated
        else "the recordings of the study"
    )
    data = [
        f"- {role}: {corpus['recordings']} recordings ({ROLES.get(role, 'others')}), "
        f"{corpus['samples']} samples of single fingers at {corpus['rate']:.0f} Hz, digest "
        f"{corpus['digest']}"
        for role, corpus in summary["data"].items()
    ]
    methods = [
        f"- {title}{f' [@{CITED[name]}]' if name in CITED else ''}: {METHODS[name].source}."
        for name, title in method_titles(plan).items()
    ]
    # Packages that are not installed have no version.
    versions = [f"{name} {number}" for name, number in summary["versions"].items() if number]
    quick = " This was a quick study; quote a full one." if summary["quick"] else ""
    paragraphs = [
        "# Methods",
        "\n".join([f"**Data**: {source}.", "", *data]),
        protocol_text(plan),
        "\n".join(["**Methods**:", "", *methods]),
        comparisons_text(tables),
        f"**Software**: {', '.join(versions)}.{quick}",
    ]
    return "\n\n".join(paragraphs) + "\n"


def bibliography(summary: Mapping[str, Any]) -> str:
    """Return the references of the methods text as BibTeX.

    Args:
        summary: contents of `study.json`, with the version of holdfast.
    """
    return (
        "@software{holdfast,\n  author = {{The authors of holdfast}},\n  title = {holdfast},\n"
        f"  version = {{{summary['versions']['holdfast']}}},\n}}\n{REFERENCES}"
    )


def compares_methods(keys: Iterable[str]) -> bool:
    """Return whether a table whose rows have these keys compares methods."""
    return not COMPARED_KEYS.isdisjoint(keys)


def protocol_text(plan: StudyPlan) -> str:
    """Return the paragraph on the protocol."""
    effort = method_effort(plan, next(iter(METHODS)))
    return (
        f"**Protocol**: The features of Kitouni et al. [@kitouni] ({', '.join(DEPLOYED_FEATURES)}) "
        f"use windows of N_w = {DEFAULT_WINDOW} samples. Folds hold out whole recordings "
        f"({effort.folds} folds) or all recordings of an object; corpora other than main are "
        "scored with a fit to all of main. Scalers, classifiers, contact thresholds and alarm "
        "thresholds come from training recordings alone. All methods are scored on the samples "
        "at which all of them have an estimate. Alarm thresholds are chosen for "
        f"{COMPARED_RATE:g} false alarm per minute of stable label, with states held for "
        f"{HOLD_TIME:g} s; those of slips for {SLIP_RATE:g} false alarm per minute of held time. "
        "Intervals are 95 %, by bootstrap over recordings; differences are paired by recording. "
        f"All random numbers come from seed {plan.seed}."
    )


def comparisons_text(tables: Sequence[ResultTable]) -> str:
    """Return the paragraph on the number of comparisons."""
    counts = {
        table.name: sum(row.interval is not None for row in table.rows)
        for table in tables
        if table.rows and compares_methods(table.rows[0].keys)
    }
    n_all = sum(row.interval is not None for table in tables for row in table.rows)
    # Intervals are not corrected for their number, so the reader is told how many there are.
    named = ", ".join(f"{name} {n}" for name, n in counts.items())
    beside = f" Tables that compare methods have {sum(counts.values())} of them ({named})."
    return (
        f"**Number of comparisons**: the tables have {n_all} values with an interval."
        f"{beside if counts else ''} No interval is corrected for their number: of a hundred "
        "true values, about five lie outside their interval."
    )
