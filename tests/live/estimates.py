"""Estimates for whoever publishes them."""

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
    """Of a thumb in newtons with a dead taxel, and a pad of the index in counts."""
    thumb = finger(faults=(Fault.DEAD,), faulty_taxels=(3, 7))
    pad = finger(ContactState.UNSTABLE, force=(100.0, 0.0, -5.5))
    both = {"thumb": thumb, "index/1": pad} | fingers
    both = {name: msgspec.structs.replace(one, time=time) for name, one in both.items()}
    return HandEstimate(time, ContactState.UNSTABLE, both)


def check_what_is_told(told):
    """What another program reads of that estimate."""
    assert told["state"] == "STABLE"
    assert told["hand"] == "UNSTABLE"
    assert (told["probability"], told["instability"]) == (0.75, 0.5)
    assert (told["force"], told["frame"]) == ([1.0, -2.0, 3.0], "thumb")
    assert told["vector"] == [100.0, 0.0, -5.5]
    assert 0 <= told["age"] < 30
    assert told["level"] == 1
    assert told["values"] == {
        "state": "STABLE",
        "reason": "",
        "faults": "dead",
        "faulty_taxels": "3, 7",
    }
