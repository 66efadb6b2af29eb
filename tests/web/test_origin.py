import pytest

from holdfast.web.connections import is_local, refusal


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "[::1]", "localhost"])
def test_local_host_names(host):
    assert is_local(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "example.org", "localhost.evil"])
def test_other_host_names(host):
    assert not is_local(host)


@pytest.mark.parametrize(
    ("host", "origin", "only_local", "text"),
    [
        ("127.0.0.1:80", None, True, None),
        ("[::1]:80", "http://[::1]:80", True, None),
        ("evil.example", None, True, "host 'evil.example' refused: this machine expected"),
        ("evil.example", None, False, None),
        ("me:80", "http://me:81", False, "origin 'http://me:81' refused: 'me:80' expected"),
        ("me:80", "null", False, "origin 'null' refused: 'me:80' expected"),
        ("\udcff", "http://a", False, r"origin 'http://a' refused: '\udcff' expected"),
    ],
)
def test_which_requests_are_refused(host, origin, only_local, text):
    assert refusal(host, origin, only_local=only_local) == text
