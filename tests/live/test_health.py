"""Health of modules: ten seconds of an open hand."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast import open_source, save_recording
from holdfast.errors import SourceError
from holdfast.live.health import (
    HealthCheck,
    check_health,
    findings_of,
    module_health,
)
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

PATCH = sensor("uskin-4x4")
TIMES = np.arange(1000) / 100


def open_hand(seed=0):
    """Readings (n, 16, 3) of an open hand that turns in a field of 78 counts."""
    rng = np.random.default_rng(seed)
    turn = np.interp(TIMES, [3, 6], [0, 1])[:, None, None] * [60, -40, 30]
    return 33_000 + np.rint(rng.normal(0, 3, (1000, 16, 3)) + turn)


def health(readings, which=PATCH, times=TIMES):
    return module_health("index", which, times, readings)


def check(**modules):
    return HealthCheck("2026-11-26", 0, modules)


def test_an_open_hand_that_turns():
    found = health(open_hand())
    assert (found.rate, found.n_samples) == (pytest.approx(100), 1000)
    assert np.allclose(found.noise, 3, rtol=0.15)
    assert (found.dead, found.stuck, found.n_zeros, found.n_gaps) == ([], [], 0, 0)
    assert found.field == pytest.approx(78 / 1.5, rel=0.1)  # from the middle of the readings
    assert findings_of(check(index=found)) == []


def test_faulty_taxels_gaps_and_jitter():
    readings = open_hand()
    readings[:, 2] = 5
    readings[:, 4, 1] = 33_000
    readings[::50, 7] = 0
    times = TIMES + np.random.default_rng(1).normal(0, 1e-3, 1000)
    times[500:] += 0.5
    found = health(readings, times=times)
    assert (found.dead, found.stuck, found.n_zeros, found.n_gaps) == ([3], ["5 y"], 20, 1)
    assert found.jitter == pytest.approx(1.4e-3, rel=0.1)
    assert findings_of(check(index=found)) == [
        "taxel 3 of index is dead",
        "axis y of taxel 5 of index never changes",
        "index reads zeros in one taxel in 2 % of its samples",
    ]


def test_a_touched_hand_is_refused():
    readings = open_hand()
    readings[520:700, 5, 2] += 200
    with pytest.raises(SourceError, match=r"index was touched at 5\.3 s"):
        health(readings)
    with pytest.raises(SourceError, match="index: 5 samples given, at least 20 expected"):
        health(open_hand()[:5], times=TIMES[:5])
    turned = open_hand() + np.interp(TIMES, [3, 6], [0, 1])[:, None, None] * [300, 0, 0]
    assert health(turned).field > 150
    with pytest.raises(SourceError, match="index was touched at "):  # a field moves no other sensor
        health(turned, replace(PATCH, magnetic=False))


def test_a_source_is_read_for_some_seconds(tmp_path):
    path = tmp_path / "open.parquet"
    save_recording(Recording("open", {"index": Tactile(PATCH, TIMES, open_hand())}), path)
    with open_source(str(path), speed=0) as source:
        found = check_health(source, 4.0)
    assert found.modules["index"].n_samples == 401


def checked(tmp_path, modules, metadata=None):
    """The check of a recording of modules, by their readings."""
    recorded = {name: Tactile(PATCH, TIMES, readings) for name, readings in modules.items()}
    path = tmp_path / "hand.parquet"
    save_recording(Recording("hand", recorded, metadata=metadata or {}), path, force=True)
    with open_source(str(path), speed=0) as source:
        return check_health(source, 10.0)


@pytest.mark.parametrize("end", [250, 1000])
def test_what_precedes_the_first_touch_is_checked(tmp_path, end):
    """A touch of the pad of `index`, short or to the end, while the field turns later."""
    pressed = open_hand()
    pressed[220:end, 5, 2] += 400
    found = checked(tmp_path, {"thumb": open_hand(1), "index": pressed})
    assert found.touch == ("index", pytest.approx(2.2, abs=0.2))
    before = round(100 * (found.touch[1] - 0.2))
    assert {x.n_samples for x in found.modules.values()} <= {before, before + 1}
    assert found.modules["index"].highest < 33_100
    (text,) = findings_of(found)
    assert text.startswith(f"index was touched at {found.touch[1]} s")


def test_a_hand_that_is_touched_from_the_start_is_told_so(tmp_path):
    released, early = open_hand(), open_hand()
    released[:400, 5, 2] += 400
    early[20:, 5, 2] += 400
    for readings, metadata in ((released, {}), (early, {}), (open_hand(), {"starts_loaded": True})):
        with pytest.raises(SourceError, match="is touched from the start: open the hand"):
            checked(tmp_path, {"index": readings}, metadata)
