import pytest

from holdfast.metrics.slip_curves import SlipIntervals, SlipSummary
from holdfast.metrics.slips import SlipMetrics
from holdfast_lab.report.table_layouts import to_markdown
from holdfast_lab.study.comparison.slip_table import (
    QUICK_SLIP_METHODS,
    slip_methods,
    slip_rows,
    tables,
    tasks,
)
from holdfast_lab.study.evaluation.evaluate_slips import SlipEvaluation
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS
from holdfast_lab.study.plan import Corpus, StudyPlan

FOUND = {"before": 1.0, "0.03": 2.0, "0.05": 3.0, "0.1": 4.0}
METRICS = SlipMetrics(
    n=50,
    n_over_1mm=20,
    n_gross=10,
    incipient=FOUND,
    gross={key: 10 * value for key, value in FOUND.items()},
    over_1mm={key: 5 * value for key, value in FOUND.items()},
    before_1mm=61.0,
    before_3mm=63.0,
    raised_quiet=0.5,
    false_alarms_per_minute={"quiet": 0.25, "held": 0.75},
    auc=0.9,
    quiet_minutes=8.0,
    held_minutes=12.0,
    onsets="truth",
)
ENDS = dict.fromkeys(FOUND, (0.0, 9.0))
INTERVALS = SlipIntervals(ENDS, ENDS, ENDS, (60.0, 62.0), None, (0.1, 1.0), {
    "quiet": (0.2, 0.3), "held": (0.7, 0.8)})  # fmt: skip


def evaluation(split="object", intervals=INTERVALS):
    summary = SlipSummary({}, METRICS, intervals, threshold_chosen=True)
    return SlipEvaluation(split, 6, summary, summary)


def corpus(name, fingers=("thumb", "index")):
    return Corpus(name, f"/{name}", ("a", "b"), "", fingers, 150.0)


def test_a_line_has_each_figure_with_its_interval():
    rows = {row.keys["figure"]: row for row in slip_rows({"method": "m"}, evaluation())}
    assert rows["within 100 ms [%]"].ours == 4.0
    assert rows["within 100 ms [%]"].interval == (0.0, 9.0)
    assert rows["gross, before [%]"].ours == 10.0
    assert rows["over 1 mm, within 50 ms [%]"].ours == 15.0
    assert (rows["before 1 mm [%]"].ours, rows["before 3 mm [%]"].ours) == (61.0, 63.0)
    assert rows["before 1 mm [%]"].interval == (60.0, 62.0)
    assert rows["false alarms per minute held"].interval == (0.7, 0.8)
    assert rows["false alarms per minute quiet"].ours == 0.25
    assert rows["quiet hold raised [%]"].ours == 0.5
    assert (rows["n slips"].ours, rows["held [min]"].ours, rows["AUC"].ours) == (50, 12.0, 0.9)
    assert {row.n for row in rows.values()} == {6}


@pytest.mark.parametrize(("quick", "n"), [(True, len(QUICK_SLIP_METHODS)), (False, 17)])
def test_each_method_has_a_task_and_lines(quick, n):
    plan = StudyPlan({"main": corpus("main"), "others": corpus("others")}, quick=quick)
    made = tasks(plan)
    assert len(made) == n
    assert all(task.arguments[0].compared == slip_methods(plan) for task in made)
    results = {task.name: {"main": evaluation(), "others": evaluation("")} for task in made}
    (table,) = tables(plan, results)
    assert {row.keys["on"] for row in table.rows} == {"by object", "unseen objects"}
    lines = {(row.keys["on"], row.keys["fitted to"], row.keys["method"]) for row in table.rows}
    assert len(lines) == 2 * n
    assert "| by object | 1/min held | true sliding | holdfast |" in to_markdown(table)


def test_methods_of_whole_hands_need_two_fingers():
    plan = StudyPlan({"main": corpus("main", ("thumb",))})
    assert not any(SLIP_METHODS[name].method.whole_hand for name in slip_methods(plan))
