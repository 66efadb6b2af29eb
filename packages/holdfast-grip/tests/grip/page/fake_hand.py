"""A fake service with the panel of a grip loop, which a test controls."""

import math

import msgspec
from aiohttp import web

from holdfast_grip import Limits
from holdfast_grip.loop.grip_faults import explain_fault
from holdfast_grip.panel import GripPanel
from live.web.page.fake_service import Service


def gripping(names=("thumb", "index", "middle", "ring"), **fields):
    """Document of a grip loop that reacts."""
    scales = [1.24, 1.5, 1.0, 2.0, 1.75, 1.9]
    return {
        "hand": "ros2:plexus?namespace=/allegro_hand", "law": "friction-margin", "armed": True,
        "limits": {
            "min_scale": 1.0, "max_scale": 2.0, "rise": 30.0, "fall": 0.3, "cooldown": 0.5,
            "max_force": 12.5, "stale_after": 0.05, "fault_after": 0.03, "recovery": None,
            "on_fault": "open", "max_rate": 400.0,
        },
        "state": "REACT", "reason": "", "stopped": False, "released": False, "time": 4.2,
        "fingers": {
            name: {"scale": scales[k], "highest": 1.75 if k else 2.0, "reason": "unstable"}
            for k, name in enumerate(names)
        },
        "n_sent": 1234, "failure": "",
        "events": [
            {"time": 3.9, "text": "grip HOLD"},
            {"time": 4.1, "text": "grip REACT: index rises from 1.000 (unstable)"},
        ],
    } | fields  # fmt: skip


def explained(grip):
    """Return the document of a grip loop with the explanation of its fault."""
    if grip is None or grip["state"] != "FAULT":
        return grip
    limits = dict(grip["limits"])
    if limits["recovery"] is None:  # infinite
        limits["recovery"] = math.inf
    fault = explain_fault(
        grip["reason"], Limits(**limits),
        armed=grip["armed"], released=grip["released"], failure=grip["failure"],
    )  # fmt: skip
    return grip | {"fault": msgspec.to_builtins(fault)}


class HandService(Service):
    """Fake service of a hand.

    Attributes:
        grip: document of the loop; None before there is one.
        stop_fails: drop the connection of a stop without an answer.
    """

    panels = (GripPanel,)
    grip, stop_fails = None, False

    def app(self):
        app = super().app()
        app.router.add_get("/api/v1/grip", self.get_grip)
        app.router.add_post("/api/v1/grip/stop", self.stop_grip)
        app.router.add_post("/api/v1/grip/reset", self.reset_grip)
        return app

    def fields(self):
        return {"grip": explained(self.grip), "locked": bool(self.grip and self.grip["armed"])}

    async def get_grip(self, _):
        return web.json_response(explained(self.grip))

    async def stop_grip(self, request):
        if self.stop_fails:
            request.transport.abort()
            return web.Response()
        self.grip |= {"state": "FAULT", "reason": "stopped", "stopped": True}
        return web.json_response(explained(self.grip))

    async def reset_grip(self, _):
        self.grip |= {"state": "HOLD", "reason": "", "stopped": False}
        return web.json_response(explained(self.grip))
