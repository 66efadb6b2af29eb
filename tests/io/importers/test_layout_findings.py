"""What readings say of their layout: each fault is found with the option that mends it."""

import numpy as np
import pytest

from holdfast.io.importers.layout_findings import layout_findings, mended
from holdfast.sensors import flat_sensor, sensor

N = 400
SKIN, PAD = sensor("anyskin"), flat_sensor("pad", 1, 5, 0.005, unit="N")
GRIP = np.interp(np.arange(N), [100, 120, 300, 320], [0, 1, 1, 0])[:, None, None]
NOISE = np.random.default_rng(4).normal(0, 1, (N, 5, 3))
REST = np.random.default_rng(5).uniform(-300, 300, (5, 3))
HEALTHY = REST + GRIP * [36.0, -24.0, 800.0] + NOISE
NEWTON = GRIP * [0.3, -0.2, 4.0] + 0.01 * NOISE
SMALL = GRIP * [200, -100, 3000] + 9 * NOISE


def changed(values, index, number):
    values = values.copy()
    values[index] = number
    return values


def wrapped(values, half):
    return (values + half) % (2 * half) - half


TURNED = HEALTHY.copy()
TURNED[:, 1, 2] = REST[1, 2] - 600 * GRIP[:, 0, 0] + NOISE[:, 1, 2]
NORMS = GRIP * [36.0, -24.0, 800.0] + NOISE
NORMS[..., 2] = np.linalg.norm(NORMS, axis=2)
ANGLES = changed(np.abs(NEWTON), np.s_[..., 2], wrapped(np.cumsum(NOISE[..., 2], axis=0), np.pi))

FOUND = {
    "unsigned 16": (np.rint(SMALL) % 65536, SKIN, "unsigned", "wrap=65536"),
    "unsigned 8": (np.rint(SMALL / 90) % 256, SKIN, "unsigned", "wrap=256"),
    "wraps": (changed(HEALTHY, np.s_[:, 0, 2], wrapped(HEALTHY[:, 0, 2] + 7500, 7930)), SKIN,
              "wraps", "wrap=158"),
    "65535": (changed(NEWTON, np.s_[:50], 65535), PAD, "sentinel", "missing=65535"),
    "-9999": (changed(HEALTHY, np.s_[::9, 2], -9999), SKIN, "sentinel", "missing=-9999"),
    "zeros": (changed(HEALTHY, np.s_[::3], 0), SKIN, "zeros", "missing=0"),
    "newtons for counts": (NEWTON / 9, SKIN, "unit", "unit=N"),
    "counts for newtons": (HEALTHY, PAD, "unit", "unit=mN"),
    "gravity": (np.array([0.1, 0.2, 9.8]) + 0.02 * NOISE, PAD, "gravity", "axes"),
    "angle": (ANGLES, PAD, "angle", "axes"),
    "norm": (NORMS, SKIN, "norm", ""),
    "turned": (TURNED, SKIN, "turned", ""),
}  # fmt: skip


@pytest.mark.parametrize(("values", "skin", "kind", "option"), FOUND.values(), ids=FOUND)
def test_each_fault_is_found(values, skin, kind, option):
    finding = layout_findings(values, skin)[0]
    assert finding.kind == kind
    assert finding.option.startswith(option)
    assert finding.stops is (kind not in ("norm", "turned"))


SOUND = {
    "a magnetic skin": (HEALTHY, SKIN),
    "forces": (NEWTON, PAD),
    "forces in steps of 0.1 N": (np.round(NEWTON, 1), PAD),
    "counts": (np.rint(30000 + SMALL), SKIN),
    "open hand": (HEALTHY[:90], SKIN),
    "no sample": (HEALTHY[:0], SKIN),
    "dead": (HEALTHY * 0 + 0.3, SKIN),
    "missing": (HEALTHY * np.nan, SKIN),
    "one jump that lasts": (HEALTHY + 9830.0 * (np.arange(N) > 200)[:, None, None]
                            * ([[0, 0, 0]] * 4 + [[0, 1, 0]]), SKIN),
}  # fmt: skip


@pytest.mark.parametrize(("values", "skin"), SOUND.values(), ids=SOUND)
def test_sound_readings_have_no_finding(values, skin):
    assert layout_findings(values, skin) == []


def test_the_option_mends():
    unsigned = (np.rint(SMALL) % 65536).astype(np.float64)
    np.testing.assert_array_equal(mended(unsigned, None, "65536"), np.rint(SMALL))
    gaps = mended(changed(HEALTHY, np.s_[::3], 0), "0", None)
    assert np.isnan(gaps[::3]).all()
    assert np.array_equal(gaps[1::3], HEALTHY[1::3])
    both = mended(changed(unsigned, np.s_[7:9], 99999), "99999", "65536")
    np.testing.assert_array_equal(both[9:], np.rint(SMALL)[9:])
