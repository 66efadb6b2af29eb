from concurrent.futures import CancelledError
from threading import Thread

import pytest

from holdfast.live.session import RequestQueue


def fail():
    raise ValueError("no")


def test_requests_are_carried_out_in_order_and_once():
    requests, calls = RequestQueue(), []
    results = [requests.append(lambda k=k: calls.append(k)) for k in range(3)]
    assert not any(result.done() for result in results)
    requests.carry_out()
    requests.carry_out()
    assert calls == [0, 1, 2]
    assert [result.result(0) for result in results] == [None] * 3


def test_a_request_that_fails_or_was_cancelled_and_the_others_go_on():
    requests, calls = RequestQueue(), []
    failing = requests.append(fail)
    cancelled, other = (requests.append(lambda k=k: calls.append(k)) for k in range(2))
    assert cancelled.cancel()
    requests.carry_out()
    with pytest.raises(ValueError, match=r"^no$"):
        failing.result(0)
    with pytest.raises(CancelledError):
        cancelled.result(0)
    assert (calls, other.result(0)) == ([1], None)


def test_requests_of_many_threads():
    requests, calls = RequestQueue(), []
    threads = [
        Thread(target=lambda: [requests.append(lambda: calls.append(1)) for _ in range(100)])
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        requests.carry_out()
    requests.carry_out()
    assert len(calls) == 800
