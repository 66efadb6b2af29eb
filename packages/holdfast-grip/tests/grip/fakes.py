"""A grip loop that a test controls."""

import math
from concurrent.futures import Future

from holdfast_grip import Limits
from holdfast_grip.documents import GripDocument, GripEntry, GripFinger


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
