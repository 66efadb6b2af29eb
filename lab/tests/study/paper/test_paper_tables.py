import pytest

from holdfast.detection import DEPLOYED_FEATURES, FEATURE_NAMES
from holdfast_lab.study.paper import paper_tables, published, random_split
from holdfast_lab.study.paper.random_split import FitBudget
from holdfast_lab.study.plan import Corpus, StudyPlan
from study.example_recordings import corpora_of, results_of, rows_of

pytestmark = pytest.mark.slow

NAMES = ("confusion", "window", "ablation", "unseen", "fingers", "zhang", "discrepancies")


@pytest.fixture(scope="module")
def corpora(tmp_path_factory):
    seeds = {"main": range(4), "fresh": range(10, 12), "others": range(20, 22)}
    return corpora_of(tmp_path_factory.mktemp("paper"), seeds)


def made(plan):
    """All tables of a plan, of one trial with few samples."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_tables, "fit_budget", lambda _: FitBudget(trials=1, n_fit=1000))
        patch.setattr(random_split, "SEARCH_SAMPLES", 1000)
        results = results_of(paper_tables.tasks(plan))
        return {table.name: table for table in paper_tables.tables(plan, results)}


@pytest.fixture(scope="module")
def quick(corpora):
    return made(StudyPlan(corpora, quick=True))


def test_confusion_has_a_line_for_each_kind_of_test_data(quick):
    table = quick["confusion"]
    assert len(table.rows) == 4 * 5 * 5
    for classifier, name in (("LogReg", "logreg"), ("SVM, balanced classes", "svm")):
        for where in {row.keys["on"] for row in table.rows}:
            found = rows_of(table, classifier=classifier, on=where)
            assert {row.keys["figure"]: row.paper for row in found} == published.CONFUSION[name]
            ours = {row.keys["figure"]: row.ours for row in found}
            assert ours["TNR"] + ours["FPR"] == pytest.approx(100)
            assert ours["TPR"] + ours["FNR"] == pytest.approx(100)


ABLATED = {value for figures in published.ABLATION.values() for value in figures.values()}


@pytest.mark.parametrize(
    ("name", "keys", "values"),
    [
        ("window", {"N_w": 14}, {*published.PUBLISHED_WINDOW[14].values()}),
        ("ablation", {"N_w": 14}, ABLATED),
        ("unseen", {}, {95.64, 96.2}),
        ("fingers", {"finger": "index"}, {95.3, 5.1, None}),
        ("fingers", {"finger": "thumb"}, {95.7, 3.5, None}),
        ("zhang", {"on": "held out"}, {62.7, 49.1, 95.3, 5.1, None}),
    ],
)
def test_values_of_the_paper_are_beside_ours(quick, name, keys, values):
    assert {row.paper for row in rows_of(quick[name], **keys)} == values


def test_each_classifier_is_fitted_once():
    corpus = Corpus("main", "data", ("a", "b"), "digest", ("thumb", "index"), 150.0)
    kinds = [
        (task.arguments[1], task.arguments[2], kind)
        for task in paper_tables.tasks(StudyPlan({"main": corpus}))
        for kind in task.arguments[3]
    ]
    assert len(kinds) == len(set(kinds)) == 2 * 2 + 2 + 8 * 4 - 1 + 2 * 9


def test_the_force_is_three_features():
    assert paper_tables.columns_of(("F_tip", "m")) == ("F_x", "F_y", "F_z", "m")
    assert paper_tables.columns_of(("F_a", "F_tip", "sigma")) == DEPLOYED_FEATURES
    assert paper_tables.columns_of(("F_a", "F_tip", "m", "sigma")) == FEATURE_NAMES
