import json
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from holdfast.errors import OutputError
from holdfast.live.teaching.protocol import View
from holdfast.live.teaching.service import TeachService, serving
from holdfast.web.guard import Guard
from web.screens import DESKTOP, PHONE, flaws

PULL = View(
    "step 4 of 8: pull, grasp 1 of 3",
    "PULL UNTIL IT SLIDES",
    "Move it to and fro first. Then pull or turn it, and rest.",
    left=23.4,
    share=0.2,
    message="3 felt",
)
HEALTH = "is this your hand: 4 modules, uskin-curved (30 taxels, 150 Hz)? taxel 17 of thumb is dead"


@pytest.fixture
def noted():
    """Messages of the browser that the page cannot prevent: none."""
    return "$^"


@pytest.fixture
def service():
    service = TeachService(Guard("127.0.0.1"))
    with serving(service, "127.0.0.1", 0) as url:
        service.url = url
        yield service


def asked(url, text=None):
    body = None if text is None else json.dumps({"text": text}).encode()
    with urlopen(Request(url, body, {"Content-Type": "application/json"}), timeout=10) as reply:
        return json.load(reply)


def test_what_a_person_sees_and_the_lines_of_a_robot(service):
    service.show(PULL, "3 of 12 grasps")
    shown = asked(f"{service.url}api/v1/teach")
    assert shown == {**PULL._asdict(), "place": "3 of 12 grasps"}
    for text in ("next", "the robot pulls"):
        asked(f"{service.url}api/v1/markers", text)
    assert service.pop() == ["next", "the robot pulls"]
    assert service.pop() == []


def test_a_request_that_is_none_is_refused(service):
    with pytest.raises(HTTPError) as failure:
        urlopen(Request(f"{service.url}api/v1/markers", b'{"key": 3}'), timeout=10)
    assert (failure.value.code, service.pop()) == (400, [])
    failure.value.close()


def test_a_token_is_needed_where_one_is_given():
    service = TeachService(Guard("127.0.0.1", "a long secret"))
    with serving(service, "127.0.0.1", 0) as url:
        with pytest.raises(HTTPError) as failure:
            asked(f"{url}api/v1/markers", "next")
        assert (failure.value.code, service.pop()) == (401, [])
        failure.value.close()
        asked(f"{url}api/v1/markers?token=a%20long%20secret", "next")
        assert service.pop() == ["next"]


def test_a_port_that_is_in_use_is_an_error(service):
    port = int(service.url.rstrip("/").rpartition(":")[2])
    with (
        pytest.raises(OutputError, match=f"{port}"),
        serving(TeachService(Guard("127.0.0.1")), "127.0.0.1", port),
    ):
        pass


@pytest.mark.parametrize("size", [PHONE, DESKTOP])
def test_the_page_has_large_words_and_keys(visit, service, size, tmp_path):
    service.show(PULL, "3 of 12 grasps")
    page = visit(service.url, size)
    page.wait_for_selector("h1:has-text('PULL UNTIL IT SLIDES')")
    assert page.text_content("#left") == "24 s"
    assert flaws(page, size) == []
    page.screenshot(path=tmp_path / "pull.png")
    page.click("#next")
    page.wait_for_timeout(300)
    assert service.pop() == ["next"]
    service.show(View(PULL.title, "NOT YET", "", None, 0.0, HEALTH, decides=True), "")
    page.wait_for_selector("body[data-passed=false]")
    assert not page.is_visible("progress")
    assert flaws(page, size) == []
    page.screenshot(path=tmp_path / "decide.png")
