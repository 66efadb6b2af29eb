"""Estimates for the tests of the publishers."""

import msgspec

from holdfast.contact import ContactEstimate, ContactState, Fault, HandEstimate, Reason

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


def check_received(received):
    """Check what another program received of that estimate."""
    assert received["state"] == "STABLE"
    assert received["hand"] == "UNSTABLE"
    assert (received["probability"], received["instability"]) == (0.75, 0.5)
    assert (received["force"], received["frame"]) == ([1.0, -2.0, 3.0], "thumb")
    assert received["vector"] == [100.0, 0.0, -5.5]
    assert 0 <= received["age"] < 30
    assert received["level"] == 1
    assert received["values"] == {
        "state": "STABLE",
        "reason": "",
        "faults": "dead",
        "faulty_taxels": "4, 8",
    }
