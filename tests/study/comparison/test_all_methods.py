from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.study.comparison import (
    all_methods,
    costs,
    jobs,
    real_recordings,
    sample_tables,
    sensitivity,
)
from holdfast.study.comparison.error_tables import force_quartiles
from holdfast.study.comparison.rows import correct_and_all
from holdfast.study.evaluation.error_breakdown import ErrorBreakdown, GripErrors
from holdfast.study.evaluation.evaluate_method import EvaluationEffort
from holdfast.study.methods import METHODS
from holdfast.study.plan import StudyPlan, scan_corpus
from holdfast.study.report.result_tables import to_json
from holdfast.study.report.table_layouts import to_html, to_latex
from study.example_recordings import recording_with_truth, save_all

FEW = ("logreg", "zhang", "jl_global_logreg")
TABLES = (
    "methods", "hands", "events", "slips", "splits", "phases", "force", "directions",
    "reliability", "cost",
)  # fmt: skip


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("comparison")
    seeds = {"main": range(4), "others": range(10, 13), "gentle": range(20, 22)}
    corpora = {
        name: scan_corpus(
            name, save_all(folder / name, [recording_with_truth(f"grasp-{s}", s) for s in each])
        )
        for name, each in seeds.items()
    }
    return StudyPlan(corpora)


@pytest.fixture(scope="module")
def few():
    """Reduce the study to few methods, folds and samples."""
    chosen = {name: METHODS[name] for name in FEW}
    with pytest.MonkeyPatch.context() as patch:
        for module in (jobs, sample_tables, all_methods, sensitivity):
            patch.setattr(module, "METHODS", chosen)
        patch.setattr(
            jobs, "EvaluationEffort", lambda: EvaluationEffort(folds=2, inner=2, max_samples=500)
        )
        patch.setattr(costs, "N_UPDATES", 50)
        patch.setattr(sensitivity, "VARIED_METHODS", ("logreg",))
        patch.setattr(sensitivity, "NOISE_LEVELS", (0.0, 2.0))
        patch.setattr(sensitivity, "SAMPLE_STEPS", (1, 5))
        patch.setattr(sensitivity, "MARGINS", (0.0, 0.1))
        yield


def results_of(tasks):
    """Return the result of each task, through msgpack as the study keeps it."""
    done = {}
    results = {}
    for task in tasks:
        key = (task.function.__qualname__, msgspec.msgpack.encode(task.arguments))
        if key not in done:
            done[key] = msgspec.msgpack.encode(task.function(*task.arguments))
        results[task.name] = msgspec.msgpack.decode(done[key], type=task.result)
    return results


@pytest.fixture(scope="module")
def results(plan, few):
    return results_of([*all_methods.tasks(plan), *sensitivity.tasks(plan)])


@pytest.fixture(scope="module")
def tables(plan, results):
    return {table.name: table for table in all_methods.tables(plan, results)}


def rows_of(table, **keys):
    return [row for row in table.rows if keys.items() <= row.keys.items()]


def test_names_of_tasks_are_unique_over_all_parts(plan, few):
    both = StudyPlan(plan.corpora, real=plan.main)
    tasks = [*all_methods.tasks(both), *sensitivity.tasks(both), *real_recordings.tasks(both)]
    names = [task.name for task in tasks]
    assert len(set(names)) == len(names)
    assert all(task.cost > 0 for task in tasks)


def test_the_tables_can_be_laid_out(tables):
    assert tuple(tables) == TABLES
    for table in tables.values():
        assert table.rows and table.note
        assert to_html(table) and to_latex(table) and to_json(table)


def test_every_method_by_every_split(tables):
    on = {(row.keys["method"], row.keys["on"]) for row in tables["methods"].rows}
    titles = {METHODS[name].title for name in FEW}
    assert {method for method, _ in on} == titles
    everywhere = {"by recording", "by object", "unseen objects"}
    assert {where for method, where in on if method == METHODS["logreg"].title} == {
        *everywhere, "gentle profile",
    }  # fmt: skip
    assert {w for m, w in on if m == METHODS["jl_global_logreg"].title} == everywhere


def test_differences_are_those_of_the_accuracies_beside_them(plan, results, tables):
    """Fingers are compared with fingers of the paper's method, hands with its hands."""
    logreg = results["methods/logreg"]
    for name, base in (("zhang", "metrics"), ("jl_global_logreg", "hand")):
        for key in ("recording", "object", "others"):
            (row,) = rows_of(
                tables["methods"],
                method=METHODS[name].title,
                on=jobs.SPLIT_TITLES[key],
                figure=sample_tables.ACCURACY_DIFFERENCE,
            )
            own = results[f"methods/{name}"][key].metrics
            reference = getattr(logreg[key], base)
            assert correct_and_all(own).keys() == correct_and_all(reference).keys()
            assert row.ours == pytest.approx(accuracy(own) - accuracy(reference))
            low, high = row.interval
            assert low <= row.ours <= high
    differences = rows_of(tables["methods"], figure=sample_tables.ACCURACY_DIFFERENCE)
    assert all(row.keys["method"] != METHODS["logreg"].title for row in differences)


def accuracy(metrics):
    right, n = np.array(list(correct_and_all(metrics).values())).sum(axis=0)
    return 100 * right / n


def test_a_hand_has_one_decision_where_fingers_have_two(plan, results, tables):
    (row,) = rows_of(
        tables["hands"], method=METHODS["logreg"].title, on="by recording", figure="accuracy [%]"
    )
    hand = results["methods/logreg"]["recording"].hand
    assert row.ours == pytest.approx(hand.pooled.accuracy)
    assert hand.pooled.n <= 4 * 1725


def test_false_alarms_add_up(tables):
    for row in rows_of(tables["events"], figure="in vain under stable label, per minute"):
        place = {key: row.keys[key] for key in ("on", "threshold", "method")}
        parts = [
            rows_of(tables["events"], **place, figure=f)[0] for f in ("after a jump", "the rest")
        ]
        assert row.ours == pytest.approx(sum(part.ours for part in parts))


def test_slips_are_counted_if_the_truth_is_known(tables):
    for row in rows_of(tables["slips"], figure="slips", on="by recording"):
        assert row.ours == 4
    for row in rows_of(tables["slips"], figure="found within 200 ms [%]"):
        assert 0 <= row.ours <= 100


def test_the_random_split_has_the_value_of_the_paper(tables):
    (row,) = rows_of(tables["splits"], split="random")
    assert row.paper == 95.3
    assert {r.keys["split"] for r in tables["splits"].rows} >= {"random", "by recording"}


def test_every_part_of_the_errors_has_its_methods(tables):
    assert {row.keys["phase"] for row in tables["phases"].rows} >= {"locked", "disturbed"}
    assert {row.keys["direction"] for row in tables["directions"].rows} == {"down"}
    methods = {row.keys["method"] for row in tables["force"].rows}
    assert methods == {METHODS[name].title for name in ("logreg", "zhang")}
    assert "down 4" in tables["directions"].note


def test_quartiles_of_the_force_of_holding_fingers():
    grips = [GripErrors(force, (1, 0), (1, 0)) for force in (0.01, 1.0, 2.0, 3.0, 4.0, 5.0)]
    parts = [ErrorBreakdown({}, grips[:3], []), ErrorBreakdown({}, grips[3:], [])]
    assert force_quartiles(parts).tolist() == [2.0, 3.0, 4.0]


def test_costs_are_positive(tables):
    assert all(row.ours > 0 and row.interval is None for row in tables["cost"].rows)
    live = [row.keys["method"] for row in tables["cost"].rows if "live" in row.keys["figure"]]
    assert live == [METHODS["logreg"].title]


def test_the_figures_can_be_drawn(plan, results):
    drawn = all_methods.figures(plan, results)
    assert [each.name for each in drawn] == [
        "methods", "alarms", "reliability", "grip", "directions",
    ]  # fmt: skip
    for each in drawn:
        each.figure.draw_without_rendering()


def test_without_torch_the_network_is_left_out_and_the_note_says_how_to_install_it(
    plan, monkeypatch
):
    monkeypatch.setattr(jobs, "METHODS", METHODS)
    monkeypatch.setattr(jobs, "find_spec", lambda _: None)
    assert "tcn" not in jobs.method_titles(plan)
    assert "pip install 'holdfast[deep]'" in jobs.network_note(plan)
    monkeypatch.setattr(jobs, "find_spec", lambda _: object())
    assert "tcn" in jobs.method_titles(plan)
    assert "6,000 windows" in jobs.network_note(plan)
    assert jobs.method_job(plan, "tcn").effort.stride == 3


def test_a_quick_study_evaluates_less(plan, monkeypatch):
    monkeypatch.setattr(jobs, "METHODS", METHODS)
    quick = StudyPlan(plan.corpora, quick=True)
    assert not set(jobs.SLOW_METHODS) & set(jobs.method_titles(quick))
    assert jobs.method_job(quick, "zhang").tests == ()
    assert jobs.method_job(quick, "logreg").tests == (
        plan.corpora["others"],
        plan.corpora["gentle"],
    )
    assert sum(t.cost for t in all_methods.tasks(quick)) < sum(
        t.cost for t in all_methods.tasks(plan)
    )


# Sensitivity, on the same recordings.


def test_without_a_variation_the_job_is_that_of_the_comparison(plan, few):
    by_name = {task.name: task for task in [*all_methods.tasks(plan), *sensitivity.tasks(plan)]}
    base, plain = by_name["methods/logreg"], by_name["sensitivity/logreg/noise-0/every-1"]
    assert (base.function, base.arguments) == (plain.function, plain.arguments)


def test_tables_and_figures_of_the_conditions(plan, results):
    tables = {table.name: table for table in sensitivity.tables(plan, results)}
    assert tuple(tables) == ("noise", "margins", "rates", "profiles", "sigma_energy")
    for table in tables.values():
        assert to_html(table) and to_json(table)
    noise = rows_of(tables["noise"], method=METHODS["logreg"].title, figure="accuracy [%]")
    assert [row.keys["noise"] for row in noise] == [0.0, 2.0]
    rates = rows_of(tables["rates"], method=METHODS["logreg"].title, figure="accuracy [%]")
    assert [row.keys["rate [Hz]"] for row in rates] == [30.0, 150.0]
    profiles = {row.keys["on"] for row in tables["profiles"].rows}
    assert profiles == {"same profile, by recording", "gentle profile"}
    drawn = sensitivity.figures(plan, results)
    assert [each.name for each in drawn] == [
        "noise_curves", "margins_curves", "rates_curves", "sigma_energy_curves",
    ]  # fmt: skip
    for each in drawn:
        each.figure.draw_without_rendering()


def test_sigma_beside_energy_is_compared_in_pairs(plan, results):
    (table,) = (t for t in sensitivity.tables(plan, results) if t.name == "sigma_energy")
    less = rows_of(table, figure=sensitivity.ACCURACY_DIFFERENCE, noise=2.0)
    assert [row.keys["measure"] for row in less] == ["energy of F_a", "energy of F_x (Zhang)"]
    by = {row.keys["measure"]: row.ours for row in rows_of(table, figure="accuracy [%]", noise=2.0)}
    for row in less:
        assert row.ours == pytest.approx(by[row.keys["measure"]] - by["sigma of F_a"])


def test_without_a_truth_there_are_no_margins(plan, tmp_path):
    blind = [replace(recording_with_truth(f"grasp-{s}", s), truth=None) for s in range(2)]
    corpus = scan_corpus("main", save_all(tmp_path / "main", blind))
    assert [s.name for s in sensitivity.sweeps(StudyPlan({"main": corpus}))] == ["noise", "rates"]
    assert [s.name for s in sensitivity.sweeps(plan)] == ["noise", "margins", "rates"]
