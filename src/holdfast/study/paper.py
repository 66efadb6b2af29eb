"""The paper's tables: its protocol as printed, and beside it what the protocol hides."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from holdfast.features import DEPLOYED, FEATURE_NAMES
from holdfast.study import printed
from holdfast.study.counts import figures
from holdfast.study.plan import Plan
from holdfast.study.pools import ENERGY
from holdfast.study.protocol import (
    ELSEWHERE,
    FRESH,
    HELD_OUT,
    OBJECTS,
    Cell,
    Effort,
    Kind,
    judge,
)
from holdfast.study.tables import Key, Row, Table
from holdfast.study.work import Task
from holdfast.training.setting import MAX_SAMPLES

WINDOW = 14
ABLATED_AT = (14, 18)
QUICK_WINDOWS = (4, 10, 14, 18)
TITLES = {"logreg": "LogReg", "svm": "SVM"}
SETS = {"all six": FEATURE_NAMES, "deployed": DEPLOYED}
TESTS = (HELD_OUT, FRESH, ELSEWHERE)
"""What the tables of many lines are measured on."""

Keys = dict[str, Key]


def tasks(plan: Plan) -> list[Task]:
    """What has to be computed for the paper's tables."""
    first = first_finger(plan)
    both: tuple[Kind, ...] = tuple((name, DEPLOYED) for name in TITLES)
    named = [_task(plan, f"fingers/{f}", f, WINDOW, both, True) for f in _fingers(plan)]
    for window in _windows(plan):
        kinds: list[Kind] = [("logreg", names) for names in SETS.values()]
        named.append(_task(plan, f"window/{window}", first, window, (*kinds, _ZHANG), False))
    for window in ABLATED_AT:
        kinds = [("logreg", columns_of(s)) for s in printed.ABLATION]
        rest = tuple(kind for kind in kinds if kind[1] not in SETS.values())
        named.append(_task(plan, f"subsets/{window}", first, window, rest, False))
    return named


def tables(plan: Plan, results: Mapping[str, Any]) -> list[Table]:
    """The paper's tables, ours beside the paper's figures.

    Args:
        plan: of the study.
        results: of the tasks, by name.
    """
    found = _Found(plan, results)
    makers = (_confusion, _window, _ablation, _unseen, _of_fingers, _zhang)
    return [*(make(found) for make in makers), printed.discrepancies()]


def first_finger(plan: Plan) -> str:
    """The finger of the tables: the paper does not name it, the index is taken."""
    return "index" if "index" in plan.main.fingers else plan.main.fingers[0]


def columns_of(subset: Iterable[str]) -> tuple[str, ...]:
    """The features of a row of Table III: F_tip is three of them."""
    return tuple(
        name
        for name in FEATURE_NAMES
        if name in subset or ("F_tip" in subset and name in ("F_x", "F_y", "F_z"))
    )


_ZHANG: Kind = ("svm", (ENERGY,))


class _Found:
    """The results of the tasks, as rows of tables."""

    def __init__(self, plan: Plan, results: Mapping[str, Any]) -> None:
        self.plan = plan
        self.cells: dict[tuple[str, int, Kind], Cell] = {}
        for task in tasks(plan):
            _, finger, window, *_ = task.arguments
            for cell in results[task.name]:
                key = (finger, window, (cell.classifier, cell.features))
                known = self.cells.get(key)
                if known is None or len(cell.counts) > len(known.counts):
                    self.cells[key] = cell

    def cell(self, kind: Kind, window: int = WINDOW, finger: str | None = None) -> Cell:
        return self.cells[finger or first_finger(self.plan), window, kind]

    def rows(
        self,
        cell: Cell,
        keys: Keys,
        names: Iterable[str],
        paper: Mapping[str, float],
        on: Iterable[str] | None = None,
    ) -> Iterator[Row]:
        """The rows of a cell: each figure on each of what it was measured on."""
        for where in cell.counts:
            if on is not None and where not in on:
                continue
            for name, row in figures(cell.counts[where], names, self.plan.seed):
                about = keys | {"on": where, "figure": name}
                yield Row(about, row.ours, paper.get(name), row.n, row.interval)

    def note(self, *more: str) -> str:
        """What holds for all tables, and more."""
        cell = self.cell(("logreg", DEPLOYED))
        finger = first_finger(self.plan)
        return " ".join([*more, *_notes(self.plan, cell, finger)])


def _confusion(found: _Found) -> Table:
    rows: list[Row] = []
    for name, title in TITLES.items():
        cell = found.cell((name, DEPLOYED))
        keys: Keys = {"classifier": title}
        rows += found.rows(
            cell, keys, ("TNR", "FPR", "FNR", "TPR", "accuracy"), printed.CONFUSION[name]
        )
    note = found.note(
        "Rates within each true class, 1 = stable: TNR and FPR share class 0, FNR and TPR "
        "class 1. The paper prints one matrix, of 'the training process', beside which every "
        "line stands."
    )
    return Table("confusion", "Table I: confusion [%]", note, rows, ("classifier", "on"))


def _window(found: _Found) -> Table:
    rows: list[Row] = []
    for window in _windows(found.plan):
        for title, names in SETS.items():
            keys: Keys = {"features": title, "N_w": window}
            cell = found.cell(("logreg", names), window)
            rows += found.rows(cell, keys, printed.RATES, printed.WINDOW[window], TESTS)
    rows.sort(key=lambda row: str(row.keys["features"]))
    note = found.note("All six features: with m; the deployed five: without.")
    title = "Table II: LogReg by window [%]"
    return Table("window", title, note, rows, ("features", "N_w", "on"))


def _ablation(found: _Found) -> Table:
    rows: list[Row] = []
    for window in ABLATED_AT:
        for subset, paper in printed.ABLATION.items():
            keys: Keys = {"N_w": window, "features": ", ".join(subset)}
            cell = found.cell(("logreg", columns_of(subset)), window)
            rows += found.rows(cell, keys, printed.RATES, paper, TESTS)
    note = found.note("The paper prints one table; which window it is for is not sure.")
    title = "Table III: LogReg by features [%]"
    return Table("ablation", title, note, rows, ("N_w", "features", "on"))


def _unseen(found: _Found) -> Table:
    rows: list[Row] = []
    for name, title in TITLES.items():
        keys: Keys = {"classifier": title}
        paper = {"accuracy": printed.UNSEEN[name]}
        on = (FRESH, ELSEWHERE, OBJECTS)
        rows += found.rows(found.cell((name, DEPLOYED)), keys, ("accuracy",), paper, on)
    title = "Accuracy on unseen data [%]"
    note = found.note("What the paper's unseen data are, it does not say.")
    return Table("unseen", title, note, rows, ("classifier", "on"))


def _of_fingers(found: _Found) -> Table:
    rows: list[Row] = []
    for finger in _fingers(found.plan):
        for name, title in TITLES.items():
            keys: Keys = {"finger": finger, "classifier": title}
            paper = _of_finger(found.plan, finger) if name == "logreg" else {}
            cell = found.cell((name, DEPLOYED), finger=finger)
            rows += found.rows(cell, keys, ("accuracy", "FDR"), paper)
    note = found.note(
        "The paper names the middle finger and the thumb; its figures of the finger that it "
        "does not name stand beside ours of the first."
    )
    lines = ("finger", "classifier", "on")
    return Table("fingers", "Every finger [%]", note, rows, lines)


def _zhang(found: _Found) -> Table:
    methods = {
        "energy of F_x (Zhang)": (_ZHANG, printed.ZHANG),
        "LogReg (the paper)": (("logreg", DEPLOYED), printed.FIRST_FINGER),
    }
    rows: list[Row] = []
    for title, (kind, paper) in methods.items():
        for window in _windows(found.plan):
            keys: Keys = {"method": title, "N_w": window}
            rows += found.rows(found.cell(kind, window), keys, ("accuracy", "FDR"), paper, TESTS)
    note = found.note(
        "Zhang: one threshold on the energy of the Haar details of F_x, by a linear SVM of one "
        "feature. The paper gives an accuracy of 'not more than' 62.7 and an FDR 'up to' 49.1, "
        "for no window in particular; an FDR is missing where nothing is called stable."
    )
    title = "Zhang et al. beside the paper's method [%]"
    return Table("zhang", title, note, rows, ("method", "N_w", "on"))


def _task(
    plan: Plan, name: str, finger: str, window: int, kinds: tuple[Kind, ...], thorough: bool
) -> Task:
    roles = ("main", "fresh", "others")
    corpora = {role: plan.corpora[role] for role in roles if role in plan.corpora}
    arguments = (corpora, finger, window, kinds, _effort(plan), plan.seed, thorough)
    return Task(f"paper/{name}", judge, arguments, list[Cell])


def _effort(plan: Plan) -> Effort:
    return Effort(trials=5, n_fit=40_000) if plan.quick else Effort(30, MAX_SAMPLES)


def _windows(plan: Plan) -> tuple[int, ...]:
    return QUICK_WINDOWS if plan.quick else printed.WINDOWS


def _fingers(plan: Plan) -> list[str]:
    """All fingers, the first of the tables first."""
    first = first_finger(plan)
    return [first, *(finger for finger in plan.main.fingers if finger != first)]


def _of_finger(plan: Plan, finger: str) -> Mapping[str, float]:
    """The paper's figures of LogReg on a finger."""
    if finger == first_finger(plan):
        return printed.FIRST_FINGER
    return printed.OTHER_FINGERS.get(finger, {})


def _notes(plan: Plan, cell: Cell, finger: str) -> Iterator[str]:
    """How the figures came about."""
    effort = _effort(plan)
    yield (
        f"The paper's protocol: samples of all recordings pooled ({finger}, where no other is "
        f"named; N_w = {WINDOW}, where no other is given), 80 % drawn at random to train, "
        f"hyper-parameters by {effort.trials} trials of Bayesian optimisation over 5 random "
        "folds of at most 10,000 of them, no contact threshold."
    )
    yield f"Each fit takes at most {effort.n_fit:,} samples, evenly spread; here {cell.n_fitted:,}."
    yield (
        "Neighbouring samples are nearly copies: the training data, the cross-validation and "
        "the 20 % held out by sample all flatter; intervals are by bootstrap over recordings."
    )
    if "fresh" in plan.corpora:
        yield "Fresh recordings: the same objects, never seen in training."
    else:
        yield (
            "Other recordings: every recording judged by a fit on others, in 5 folds, with the "
            "hyper-parameters found on the 80 %."
        )
    if OBJECTS in cell.counts and "others" not in plan.corpora:
        yield "Other objects: every object judged by a fit on the others, likewise."
    if OBJECTS not in cell.counts:
        yield "Other objects: none, for the recordings do not say what was held."
