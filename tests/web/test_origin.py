import pytest

from holdfast.web.connections import is_local, refusal


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "[::1]", "localhost"])
def test_local_host_names(host):
    assert is_local(host)


@pytest.mark.parametrize(
    ("host", "origin", "only_local", "named"),
    [
        ("127.0.0.1:80", None, True, None),
        ("[::1]:80", "http://[::1]:80", True, None),
        ("evil.example", None, True, "'evil.example'"),
        ("evil.example", None, False, None),
        ("me:80", "http://me:81", False, "'http://me:81'"),
        ("me:80", "null", False, "'null'"),
        ("\udcff", "http://a", False, "'http://a'"),
    ],
)
def test_which_requests_are_refused(host, origin, only_local, named):
    found = refusal(host, origin, only_local=only_local)
    assert found is None if named is None else named in found
