import math

import pytest

from holdfast_lab.study.comparison.shipped import (
    NO_REPORT,
    ModelCounts,
    model_rows,
    shipped_counts,
    tables,
    tasks,
    taught_counts,
)
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from study.example_recordings import recording_with_truth, save_all

COUNTS = ModelCounts(
    stable=(100, 90), unstable=(50, 40), events=(4, 1.0), alarms=(3, 2.0),
    delays=[-0.01, 0.1, math.inf, 0.2], speeds=[1.0, 3.0, 4.0, 30.0], over_1mm=(2, 1),
    false_slips=6, finger_minutes=4.0, hand_minutes=2.0, impacts=(10, 2),
)  # fmt: skip


def values(rows):
    return {row.keys["figure"]: row.ours for row in rows}


def test_the_figures_of_a_model_by_hand():
    found = values(model_rows({}, [COUNTS]))
    assert found["stable called STABLE [%]"] == pytest.approx(90)
    assert found["unstable or open, not STABLE [%]"] == pytest.approx(80)
    assert found["events missed at 50 ms [%]"] == pytest.approx(25)
    assert found["slips found within 0.1 s [%]"] == pytest.approx(50)
    assert found["before 1 mm [%]"] == pytest.approx(50)
    assert found["impacts with a slip alarm [%]"] == pytest.approx(20)
    assert found["false alarms of the hand, per minute"] == pytest.approx(1.5)
    assert found["false slips of a finger, per minute"] == pytest.approx(1.5)
    assert found["false slips of the hand, per minute"] == pytest.approx(3.0)


@pytest.mark.slow
def test_the_tables_of_recordings(tmp_path):
    def corpus(role, seeds):
        made = [recording_with_truth(f"{role}-{seed}", seed) for seed in seeds]
        return scan_corpus(role, save_all(tmp_path / role, made))

    corpora = {"main": corpus("main", range(2)), "others": corpus("others", range(2, 4))}
    corpora |= {role: corpus(role, range(4, 6)) for role in ("taught", "taught-pushes")}
    plan = StudyPlan(corpora, full=True)
    names = [task.name for task in tasks(plan)]
    assert names[:3] == [f"shipped/builtin:{name}" for name in ("noise-floor", "any", "twin")]
    assert names[3:] == [f"taught/{n}" for n in (2, 4, 8, 12)]
    assert tasks(StudyPlan({"main": corpora["main"]})) == []
    tests = {"others": corpora["others"]}
    results = {name: shipped_counts(name.removeprefix("shipped/"), tests) for name in names[1:2]}
    # The twin's fingers have other sensors than these recordings.
    results["shipped/builtin:twin"] = results["shipped/builtin:any"]
    results["taught/2"] = taught_counts(2, [corpora["taught"]], tests)
    models, speeds = tables(plan, results)
    assert {row.keys["model"] for row in models.rows} >= {"builtin:any", NO_REPORT}
    assert all(row.keys["on"] == "unseen objects" for row in speeds.rows)
