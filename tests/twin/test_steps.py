"""The binding of the steps in C: what it refuses."""

import numpy as np
import pytest

from holdfast.sensors import sensor
from holdfast.twin import steps
from holdfast.twin.control import draw_controller
from holdfast.twin.hand import HandModel
from holdfast.twin.objects import object_named, solid
from holdfast.twin.operator import draw_tremor
from holdfast.twin.surface import curved_fingertip
from holdfast.twin.uskin import Uskin, UskinParameters

from .grip import Grip

CAN = object_named("can")
RANDOM = np.random.default_rng(0)
TREMOR = draw_tremor(RANDOM)
BODY = np.zeros(18)
HALF = np.zeros(16)


def touched(**changes):
    grip = Grip(CAN)
    given = {"state": grip.state, "constants": grip.constants, "bodies": grip.bodies, "dt": 1e-3}
    for name, change in changes.items():
        given[name] = change(given[name])
    steps.touch(*given.values())


def fields(**changes):
    return lambda old: old._replace(
        **{name: make(getattr(old, name)) for name, make in changes.items()}
    )


def controlled(tick=0, joints=HALF, torques=HALF, **changes):
    controller = draw_controller(np.random.default_rng(0), 1.0, 0.003, 0.0)._replace(**changes)
    steps.control(controller, tick, joints, HALF, HALF, 0.003, torques.copy())


def bodies_of(**changes):
    steps.fill_bodies(HandModel.build(CAN).arrays._replace(**changes), np.zeros((5, 18)))


def read(n_drawn=91, **changes):
    skin = Uskin(UskinParameters(), sensor("uskin-curved"), curved_fingertip().nodes, RANDOM)
    readout = skin.readout()
    constants = readout._constants._replace(**changes)
    drawn, counts = np.zeros((1, n_drawn)), np.zeros((1, 30, 3), np.uint16)
    steps.read_out(np.zeros((1, 30, 3)), np.ones(1), drawn, constants, readout._state, counts)


def on_path(first=(12, 0, 4, 8), n=25):
    numbers = np.linspace(0.1, 0.0, n)
    joints = np.zeros((4, n, 4))
    steps.fill_targets(numbers, joints, np.array(first, np.intc), np.zeros(4), HALF.copy())


REFUSED = {
    "type": (lambda: steps.probe(solid(CAN).astype("f4"), 0, 0, 0), TypeError, "solid"),
    "byte order": (lambda: steps.probe(solid(CAN).astype(">f8"), 0, 0, 0), TypeError, "solid"),
    "axes": (lambda: steps.probe(solid(CAN)[None], 0, 0, 0), ValueError, "solid"),
    "length": (lambda: steps.probe(solid(CAN)[:-1].copy(), 0, 0, 0), ValueError, "solid"),
    "number": (lambda: steps.probe(solid(CAN), 0, "x", 0), TypeError, "real number"),
    "count": (lambda: steps.probe(solid(CAN)), TypeError, "probe"),
    "not contiguous": (lambda: steps.probe(np.zeros(32)[::2], 0, 0, 0), ValueError, "contiguous"),
    "no array": (lambda: steps.probe(None, 0, 0, 0), TypeError, "bytes-like"),
    "points": (
        lambda: steps.distances(solid(CAN), np.zeros((3, 3)), np.zeros(2)),
        ValueError,
        "out",
    ),
    "read-only": (
        lambda: touched(state=fields(wrench=lambda old: np.frombuffer(bytes(48)))),
        ValueError,
        "read-only",
    ),
    "no field": (lambda: touched(constants=lambda old: old.nodes), AttributeError, "nodes"),
    "nodes": (
        lambda: touched(constants=fields(nodes=lambda old: old[1:].copy())),
        ValueError,
        "nodes",
    ),
    "no tips": (
        lambda: touched(state=fields(bristles=lambda old: old[:0])),
        ValueError,
        "bristles",
    ),
    "bodies": (lambda: touched(bodies=lambda old: old[:-1].copy()), ValueError, "bodies"),
    "link": (
        lambda: bodies_of(tips=np.full(4, 99, np.intc)),
        ValueError,
        "tips, object_body, roots",
    ),
    "links": (lambda: bodies_of(tips=np.arange(4.0)), TypeError, "tips"),
    "object": (lambda: bodies_of(object_body=-1), ValueError, "tips, object_body, roots"),
    "joints": (lambda: controlled(joints=np.zeros(15)), ValueError, "joints, bias or torques"),
    "torques": (lambda: controlled(torques=np.zeros(15)), ValueError, "joints, bias or torques"),
    "errors": (lambda: controlled(errors=np.zeros((0, 16))), ValueError, "errors"),
    "tick": (lambda: controlled(tick=-1), ValueError, "out of range"),
    "large tick": (lambda: controlled(tick=2**63), OverflowError, "too big"),
    "axis": (lambda: steps.tremor_at(TREMOR, 0.0, 3), ValueError, "out of range"),
    "physics": (
        lambda: steps.advance_sample(None, None, None, 0, HALF, None),
        AttributeError,
        "arrays",
    ),
    "line": (lambda: read(line=0), ValueError, "line"),
    "drawn": (lambda: read(90), ValueError, "line"),
    "readings": (lambda: read(limits=np.ones(3, np.uint16)), TypeError, "limits"),
    "finger": (lambda: on_path((12, 0, 4, 13)), ValueError, "first, grid"),
    "path": (lambda: on_path(n=1), ValueError, "first, grid"),
    "pose": (
        lambda: steps.hold_wrench(BODY, np.zeros(3), 1.0, 0.0, TREMOR, 0.0, 0.0),
        ValueError,
        "anchor",
    ),
}


@pytest.mark.parametrize(("call", "error", "message"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_fit_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_what_fits_is_taken():
    touched()
    controlled()
    bodies_of()
    read()
    on_path()
    assert steps.tremor_at(TREMOR, 0.0, 2)
