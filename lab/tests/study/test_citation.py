import re

import pytest

from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.study.citation import CITED, bibliography, compares_methods, methods_text
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import StudyPlan, scan_corpus

from .example_recordings import save_synthetic

SUMMARY = {
    "data": {"main": {"recordings": 3, "samples": 10350, "rate": 150.0, "digest": "abc"}},
    "versions": {"holdfast": "1.2.3", "torch": None},
    "quick": True,
}


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    folder = save_synthetic(tmp_path_factory.mktemp("citation") / "main", range(3))
    plan = StudyPlan({"main": scan_corpus("main", folder)}, quick=False, seed=17)
    tables = [
        ResultTable(name, "", "", [
            Row({key: "a", "figure": f}, 1.0, None, 3, interval)
            for f, interval in (("x", (0.0, 2.0)), ("y", None), ("z", (0.0, 3.0)))
        ], (key,))
        for name, key in (("events", "method"), ("window", "N_w"))
    ]  # fmt: skip
    return methods_text(plan, SUMMARY, tables)


def test_the_protocol(text):
    assert (
        "- main: 3 recordings (used for training), 10350 samples of single fingers at 150 Hz, "
        in text
    )
    assert "digest abc" in text
    assert "5 folds" in text
    assert "from seed 17." in text
    assert "holdfast 1.2.3. This was a quick study; quote a full one.\n" in text
    assert "torch" not in text.rpartition("**Software**")[2]


def test_every_method_has_its_source(text):
    for method in METHODS.values():
        if method.name != "tcn":
            key = f" [@{CITED[method.name]}]" if method.name in CITED else ""
            assert f"- {method.title}{key}: {method.source}." in text


def test_the_number_of_comparisons(text):
    assert "the tables have 4 values with an interval. Tables that compare methods have 2" in text
    assert "(events 2)" in text


def test_tables_that_compare_methods():
    assert compares_methods(("on", "baseline", "figure"))
    assert not compares_methods(("classifier", "on", "figure"))


def test_the_citations_are_in_the_references(text):
    entries = set(re.findall(r"^@\w+\{(\w+),$", bibliography(SUMMARY), re.M))
    cited = set(re.findall(r"\[@(\w+)\]", text))
    assert cited | {CITED["tcn"], "holdfast"} == entries
    assert "version = {1.2.3}" in bibliography(SUMMARY)
    assert bibliography(SUMMARY).count("{") == bibliography(SUMMARY).count("}")
