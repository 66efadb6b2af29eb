"""Random hands, and samples of theirs in which everything goes wrong that the kernel looks for."""

import numpy as np

from holdfast.detection import Tare
from holdfast.detection.plan import Start, StreamPlan
from holdfast.detection.specs import KINDS, RELATIVE_KINDS, FeatureSpec
from holdfast.sensors import Sensor

RATES = (20.0, 60.0, 150.0, 500.0, 1000.0)


def random_sensor(rng):
    """Return a sensor of 1 to 130 taxels, flat or not, in counts or in newtons."""
    n_taxels = int(rng.choice([1, 2, 3, 5, 16, 30, 64, 65, 130]))
    axes = np.linalg.qr(rng.normal(size=(n_taxels, 3, 3)))[0]
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]  # no mirror
    flat = rng.random() < 0.5
    normal = np.eye(3)[rng.integers(3)] if rng.random() < 0.7 else rng.normal(size=3)
    in_counts = rng.random() < 0.6
    return Sensor(
        name=f"made-{n_taxels}-{rng.integers(1e9)}",
        positions=0.01 * rng.normal(size=(n_taxels, 3)),
        rotations=np.tile(np.eye(3), (n_taxels, 1, 1)) if flat else axes,
        normal=normal / np.linalg.norm(normal),
        rate=float(rng.choice(RATES)),
        unit="count" if in_counts else "N",
        range=(0.0, 65535.0) if in_counts else None,
    )


def random_features(rng, n_taxels):
    """Return features of all kinds, or of one family, for a sensor."""
    specs = []
    relative, force = rng.random() < 0.6, rng.random() < 0.7
    seconds = rng.choice([0.004, 0.02, 0.1, 0.3], size=2, replace=False)
    for kind in RELATIVE_KINDS if relative else ():
        if KINDS[kind].min_taxels > n_taxels or rng.random() < 0.4:
            continue
        scope = "hand" if rng.random() < 0.2 else "finger"
        lag = float(rng.choice(seconds))
        specs.append(FeatureSpec(kind, transform="relative", scope=scope, seconds=lag))
    for kind in ("F_a", "F_x", "m", "sigma", "sigma_xyz", "change") if force or not specs else ():
        window = int(rng.choice([2, 4, 6, 14, 30, 64])) if KINDS[kind].window == "window" else 0
        transforms = ["none", "log", "noise"] if kind == "sigma" and window > 2 else ["none", "log"]
        transform = str(rng.choice(transforms))
        for scope in ("finger", "hand") if rng.random() < 0.3 else ("finger",):
            floor = 0.5 if transform == "log" else 0.0
            specs.append(FeatureSpec(kind, window, transform, scope, floor))
    return tuple(specs)


def random_plan(rng):
    """Return a plan for one to four fingers, with features that they share or not."""
    sensors = {f"finger{i}": random_sensor(rng) for i in range(rng.integers(1, 5))}
    if rng.random() < 0.3:
        sensors = dict.fromkeys(sensors, sensors["finger0"])
    few = min(sensor.n_taxels for sensor in sensors.values())
    shared = random_features(rng, few)
    alike = rng.random() < 0.5
    tare = rng.choice(["0.3", "first", "none", "1.0"])
    ignore = {
        name: rng.choice(
            sensor.n_taxels, int(rng.integers(sensor.n_taxels)), replace=False
        ).tolist()
        for name, sensor in sensors.items()
        if rng.random() < 0.2
    }
    return StreamPlan(
        sensors=sensors,
        features={n: shared if alike else random_features(rng, few) for n in sensors},
        window=int(rng.choice([2, 6, 14, 40])),
        tare=Tare.parse(str(tare)),
        rate=float(rng.choice(RATES)),
        ignore=ignore,
        start=Start(bool(rng.random() < 0.2)),
    )


class _Finger:
    """Readings of a finger, in a regime that changes now and then."""

    def __init__(self, rng, sensor, rate):
        self._rng, self._n, self._in_counts = rng, sensor.n_taxels, sensor.unit == "count"
        self._zero, self._step = (30_000.0, 1.0) if self._in_counts else (0.0, 0.002)
        self._rate, self._last, self._left, self._load = rate, None, 0, np.zeros(3)
        self._ring = None

    def _change_regime(self):
        rng = self._rng
        self._left = int(rng.integers(1, max(2, 3 * self._rate)))
        self.regime = str(rng.choice(
            ["free", "held", "held", "sliding", "still", "zeros", "repeated", "offset", "rail",
             "tiny", "noisy", "saturated", "invalid", "pull", "huge", "release",
             "jumped"],
            p=[0.2, 0.1, 0.1, 0.1, 0.05, 0.03, 0.05, 0.02, 0.02, 0.02, 0.06, 0.03, 0.06, 0.04,
               0.02, 0.04, 0.06],
        ))  # fmt: skip
        some = rng.integers(1, self._n + 1) if rng.random() < 0.3 else min(self._n, 1)
        self._taxels = rng.choice(self._n, some, replace=False)
        self._frozen = rng.choice(self._n, rng.integers(0, self._n), replace=False)
        self._freezes = rng.random() < 0.2
        if self.regime in ("held", "sliding", "release"):
            self._load = rng.normal(size=3) * [20, 20, 100] * rng.choice([1, 1, 5])
        if self.regime in ("free", "release"):
            self._load = np.zeros(3)
        if self.regime == "pull":
            self._load = np.array([0.0, 0.0, -60.0])
        self._ring = rng.integers(0, 30, (int(rng.integers(3, 70)), self._n, 3))
        self._jump = float(rng.choice([256, -256, 5000, 65536]))
        self._bad = rng.choice([np.nan, np.inf, -np.inf, 1e9, -1e9])

    def next(self, k):
        """Return the readings of sample k."""
        rng, regime = self._rng, None
        if self._left <= 0:
            self._change_regime()
        self._left -= 1
        regime = self.regime
        load = self._load * (rng.uniform(0.7, 1.3) if regime == "sliding" else 1.0)
        readings = load + rng.normal(0, 1 + (regime == "sliding") * 5, (self._n, 3))
        if self._in_counts:
            readings = np.rint(readings)
        if self._freezes and self._last is not None:
            readings[self._frozen] = ((self._last - self._zero) / self._step)[self._frozen]
        if regime == "noisy":
            readings[self._taxels] += 3000 * rng.normal(size=(len(self._taxels), 3))
        readings = self._zero + self._step * readings
        if regime == "still" and self._last is not None:
            readings = self._last
        elif regime == "zeros":
            readings[self._taxels] = 0.0
        elif regime == "repeated":
            period, place = divmod(k, len(self._ring))
            moved = period if self._freezes else 0  # the same sum, of other readings
            readings = self._zero + self._step * np.roll(self._ring[place], moved, axis=0)
        elif regime == "offset":
            readings = readings + 20_000 * self._step
        elif regime == "rail":
            readings = self._zero * 0 + 3.0 * self._step * rng.integers(0, 3, readings.shape)
        elif regime == "tiny":
            readings = 1e-318 * rng.integers(0, 3, readings.shape)
        elif regime == "saturated":
            readings[self._taxels] = rng.choice([0.0, 65535.0])
        elif regime == "invalid":
            readings[self._taxels, rng.integers(3)] = self._bad
        elif regime == "jumped":
            readings[self._taxels[0], 1] += self._jump * self._step
        elif regime == "huge" and not self._in_counts:
            readings = readings * 1e200
        if np.isfinite(readings).all() and regime != "huge":
            self._last = readings.copy()
        return readings


def random_rows(rng, plan, n):
    """Yield n samples of a plan's hand: readings, present and time; times increase."""
    fingers = [_Finger(rng, sensor, plan.rate) for sensor in plan.sensors.values()]
    time, jitter = float(rng.uniform(-10, 1e6)), float(rng.choice([0.0, 0.02, 0.4]))
    for k in range(n):
        step = (1.0 + jitter * rng.uniform(-1, 1)) / plan.rate
        if rng.random() < 0.004:
            step = float(rng.choice([2, 4, 0.08 * plan.rate, 0.5 * plan.rate])) / plan.rate
        time += step
        present = rng.random(len(fingers)) > 0.005
        yield np.concatenate([finger.next(k) for finger in fingers]), present, time
