"""The check of layouts finds what it is meant to find."""

import pytest

from web.screens import DESKTOP, PHONE, flaws


@pytest.fixture(scope="session")
def noted():
    return "nothing"


@pytest.mark.parametrize(
    ("body", "size", "expected"),
    [
        ("<p>one</p><p>two</p>", PHONE, []),
        ("<p>one</p><p style='margin-top:-30px'>two</p>", PHONE, ["overlap: p one | p two"]),
        ("<p style='width:500px'>wide</p>", PHONE, ["the page is 500 px wide", "outside: p wide"]),
        ("<button style='height:30px;width:90px'>a</button>", PHONE, ["small: button a 90 x 30"]),
        ("<button style='height:30px;width:90px'>a</button>", DESKTOP, []),
        ("<h2 style='width:50px;overflow:hidden'>longlong</h2>", PHONE, ["cut off: h2 longlong"]),
        ("<div style='height:20px;overflow:auto'><p>a</p><p>b</p></div><p>c</p>", PHONE, []),
    ],
)
def test_flaws(visit, body, size, expected):
    style = "<style>* { margin: 0; line-height: 40px; }</style>"
    page = visit("about:blank", size)
    page.set_content(f"<!doctype html>{style}{body}")
    assert flaws(page, size) == expected
