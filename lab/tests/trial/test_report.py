import re

import msgspec
import pytest
from holdfast_lab.report.html_report import html_report
from holdfast_lab.trial.report import Example, report_sections, summary_text

from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.document import document_of, example_of
from holdfast_lab.trial.plan import TrialPlan

from .example_results import results_of

pytestmark = pytest.mark.slow

COURSE = TrialCourse(times=[-0.5, 0.0, 0.5], force=[2.0, 2.0, 0.5], least=[1.0, 1.0, 2.0],
                     slip_speed=[0.0, 0.0, 0.1], lost_at=0.5)  # fmt: skip
EXAMPLE = Example("Trial 0: can.", {"fixed": COURSE, "holdfast": COURSE}, b"RIFF")


def report(results, example=None):
    plan = TrialPlan(tuple(results), 12)
    document = document_of(plan, results, example_of(results))
    sections = report_sections(document, results, example)
    return html_report("T", {"seed": 0}, sections), document


@pytest.fixture(scope="module")
def page():
    return report(results_of(), EXAMPLE)[0]


def test_the_summary_comes_first_and_names_each_goal(page):
    text = re.sub(r"<[^>]*>", "", page[page.index("<h2>Summary") : page.index("<nav")])
    assert "On 11 trials of the twin, holdfast dropped 0.0 (0.0 to 0.0) % of the objects" in text
    assert "a grip of fixed force 63.6" in text
    assert re.search(r"90 % below \[mm\]: 2.0 .* for holdfast", text)
    assert text.count("reached.") == 5


def test_a_goal_that_is_missed_is_said(page):
    results = results_of()
    results["holdfast"] = [
        msgspec.structs.replace(
            one, law="holdfast", n_false=2, slipped=False, reaction=float("nan")
        )
        for one in results["holdfast"]
    ]
    text = summary_text(report(results)[1])
    assert re.search(r"false reactions per minute: 60.0 .*; the goal is at most 1: missed", text)
    assert "falls [ms]: not known" in text and "nothing slipped" in text


def test_every_part_of_the_issue_is_in_the_report(page):
    for name in (
        "laws", "slips", "forces", "drops", "paired-fixed", "paired-holdfast", "kinds", "objects",
        "fingers",
    ):  # fmt: skip
        assert f'id="table-{name}"' in page
    for name in ("film", "course", "force", "distributions", "kinds"):
        assert f'id="figure-{name}"' in page
    assert "data:image/webp;base64,UklGRg==" in page
    for words in ("What the twin cannot show", "A drop counts as infinite", "by bootstrap over"):
        assert words in page


def test_a_browser_shows_all_of_it(browser, tmp_path):
    from PIL import Image

    pictures = [Image.new("RGB", (16, 8), colour) for colour in ("red", "blue")]
    pictures[0].save(tmp_path / "film.webp", save_all=True, append_images=pictures[1:])
    film = (tmp_path / "film.webp").read_bytes()
    (tmp_path / "report.html").write_text(report(results_of(n=6), EXAMPLE._replace(film=film))[0])
    page = browser.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    for width in (390, 768, 1440):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("document.querySelector('#figure-film img').naturalWidth") == 16
    assert page.locator("main svg").count() == 4
    page.close()


def test_the_rule_of_the_film_is_stated(page):
    assert "the first of the set that fixed loses and holdfast holds" in page


def test_without_an_example_the_report_says_so():
    page, _ = report(results_of(("fixed", "pr2")))
    assert "There is no film: no trial is such, or one of the laws was not run." in page
    assert 'id="figure-film"' not in page
    assert "fixed dropped 63.6" in page


def test_without_a_renderer_the_reason_is_given():
    example = EXAMPLE._replace(film=b"", reason="cannot render: no back end")
    page, _ = report(results_of(), example)
    assert "There is no film: cannot render: no back end." in page
    assert 'id="figure-course"' in page


def test_one_law_alone_has_a_report():
    page, _ = report(results_of(("pr2",)))
    assert 'id="table-laws"' in page and 'id="table-paired' not in page
