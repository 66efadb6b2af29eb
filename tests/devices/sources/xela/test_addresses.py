import re
import socket

import pytest

from holdfast.devices.sources.xela import addresses as module
from holdfast.devices.sources.xela.addresses import server_addresses
from holdfast.devices.uri import parse


def found(text):
    return [str(address) for address in server_addresses(parse(text)[1])]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("xela:", ["127.0.0.1:5000"]),
        ("xela://", ["127.0.0.1:5000"]),
        ("xela://:5001", ["127.0.0.1:5001"]),
        ("xela://10.0.0.7", ["10.0.0.7:5000"]),
        ("xela://10.0.0.7:80/", ["10.0.0.7:80"]),
        ("xela://Hand.local?values=counts", ["hand.local:5000"]),
        ("xela://[::1]:5000", ["[::1]:5000"]),
    ],
)
def test_addresses(text, expected):
    assert found(text) == expected


def test_auto_also_tries_the_address_of_the_default_route(monkeypatch):
    monkeypatch.setattr(module, "own_address", lambda: "10.1.2.3")
    assert found("xela://auto") == ["127.0.0.1:5000", "10.1.2.3:5000"]
    assert found("xela://auto:6000") == ["127.0.0.1:6000", "10.1.2.3:6000"]


@pytest.mark.parametrize("own", [None, "127.0.0.1"])
def test_auto_without_another_address(monkeypatch, own):
    monkeypatch.setattr(module, "own_address", lambda: own)
    assert found("xela://auto") == ["127.0.0.1:5000"]


def test_without_a_default_route_there_is_no_own_address(monkeypatch):
    def refuse(*_):
        raise OSError("Network is unreachable")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    assert module.own_address() is None


@pytest.mark.parametrize(
    "text",
    [
        "xela://host:port",
        "xela://host:70000",
        "xela://host:0",
        "xela://host/topic",
        "xela://me@host",
    ],
)
def test_invalid_addresses(text):
    with pytest.raises(ValueError, match=re.escape(text)):
        found(text)
