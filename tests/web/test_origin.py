import pytest

from holdfast.web.connections import is_local, refusal

PREFIXES = ("[::1]", "[::1]:80", "[::1", "[::1%", "localhost:80@", "127.0.0.1:", "127.0.0.1:80.")
"""What makes a name of another machine look like one of this machine."""


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "[::1]", "localhost"])
def test_local_host_names(host):
    assert is_local(host)


@pytest.mark.parametrize(
    ("host", "origin", "only_local", "named"),
    [
        ("127.0.0.1:80", None, True, None),
        ("[::1]:80", "http://[::1]:80", True, None),
        ("evil.example", None, True, "'evil.example'"),
        *((f"{name}evil.example", None, True, f"'{name}evil.example'") for name in PREFIXES),
        ("[::1]evil.example", None, False, "[IPv6]:PORT expected"),
        ("evil.example", None, False, None),
        ("me:80", "http://me:81", False, "'http://me:81'"),
        ("me:80", "null", False, "'null'"),
        ("\udcff", "http://a", False, "'http://a'"),
    ],
)
def test_which_requests_are_refused(host, origin, only_local, named):
    found = refusal(host, origin, only_local=only_local)
    assert found is None if named is None else named in found
