"""Estimates for the tests of the publishers."""

import math
from concurrent.futures import Future

import msgspec

from holdfast.contact import ContactEstimate, ContactState, Fault, HandEstimate, Reason
from holdfast.grip import Limits
from holdfast.live.documents import GripDocument, GripEntry, GripFinger

UNITS = {"thumb": "N", "index/1": "count"}


def finger(state=ContactState.STABLE, **given):
    fields = {
        "time": 7.0, "state": state, "reason": Reason.NONE, "stable_probability": 0.75,
        "instability": 0.5, "force": (1.0, -2.0, 3.0),
    }  # fmt: skip
    return ContactEstimate(**(fields | given))


def estimate(time=7.0, **fingers):
    """Estimate of a thumb in newtons with a dead taxel, and a pad of the index in counts."""
    thumb = finger(faults=(Fault.DEAD,), faulty_taxels=(3, 7))  # indices
    pad = finger(ContactState.UNSTABLE, force=(100.0, 0.0, -5.5))
    both = {"thumb": thumb, "index/1": pad} | fingers
    both = {name: msgspec.structs.replace(one, time=time) for name, one in both.items()}
    return HandEstimate(time, ContactState.UNSTABLE, both)


class FakeGrip:
    """A grip loop that holds, and can be stopped."""

    def __init__(self, **fields):
        self.fields, self.calls, self.listeners = fields, [], []
        self.error, self.answers = None, True

    def document(self):
        limits = Limits(
            min_scale=1.0, max_scale=2.0, rise=30.0, fall=0.3, cooldown=0.5, max_force=None,
            stale_after=0.05, fault_after=0.03, recovery=math.inf, on_fault="hold",
            max_rate=400.0,
        )  # fmt: skip
        fields = {
            "hand": "log:hand", "law": "holdfast", "armed": True, "limits": limits,
            "state": "HOLD", "reason": "", "stopped": False, "released": False, "time": 7.0,
            "fingers": {"thumb": GripFinger(scale=1.25, highest=2.0, reason="")},
            "n_sent": 3, "failure": "", "events": [GripEntry(6.5, "grip HOLD")],
        }  # fmt: skip
        return GripDocument(**(fields | self.fields))

    def stop(self):
        self.fields |= {"state": "FAULT", "reason": "stopped", "stopped": True}
        return self.answer("stop")

    def reset(self):
        self.fields |= {"state": "HOLD", "reason": "", "stopped": False}
        return self.answer("reset")

    def answer(self, call):
        self.calls.append(call)
        future = Future()
        if self.error is not None:
            future.set_exception(self.error)
        elif self.answers:
            future.set_result(None)
        return future

    def add_listener(self, listener):
        self.listeners.append(listener)

    def happen(self, text, time):
        for listener in self.listeners:
            listener(text, time)


def check_received(received):
    """Check what another program received of that estimate."""
    assert received["state"] == "STABLE"
    assert received["hand"] == "UNSTABLE"
    assert (received["probability"], received["instability"]) == (0.75, 0.5)
    assert (received["force"], received["frame"]) == ([1.0, -2.0, 3.0], "thumb")
    assert received["vector"] == [100.0, 0.0, -5.5]
    assert 0 <= received["age"] < 30
    assert received["level"] == 1
    assert (received["grip"], received["scale"]) == ("HOLD", 1.25)
    assert received["grip_message"] == "HOLD"
    assert received["values"] == {
        "state": "STABLE",
        "reason": "",
        "faults": "dead",
        "faulty_taxels": "4, 8",
    }
