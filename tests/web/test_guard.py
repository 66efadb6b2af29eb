import pytest

from holdfast.web.guard import Guard, is_local


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "[::1]", "localhost"])
def test_names_of_this_machine(host):
    assert is_local(host)
    Guard(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "example.org", "localhost.evil"])
def test_other_names_need_a_token(host):
    assert not is_local(host)
    with pytest.raises(ValueError, match="opens the service to the network: give --token SECRET"):
        Guard(host)
    Guard(host, "secret")


def test_an_empty_token_is_none():
    with pytest.raises(ValueError, match=r"^--token: some text expected, none given$"):
        Guard("127.0.0.1", " ")
