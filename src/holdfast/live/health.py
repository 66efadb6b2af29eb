"""Health of the modules of a hand, from ten seconds in which the hand is open."""

import math
import time
from collections.abc import Mapping
from datetime import date
from typing import Any, NamedTuple

import msgspec
import numpy as np

from holdfast.devices.sources import Source
from holdfast.errors import SourceError
from holdfast.io.importers.layout_findings import layout_findings
from holdfast.recordings import GAP_PERIODS, STARTS_LOADED
from holdfast.sensors import Sensor, taxel_number
from holdfast.sensors.types import Array, Flags

AVERAGED_SECONDS = 0.2
"""Time over which readings are averaged to find a touch and a field [s]."""
TOUCH_TO_NOISE = 20.0
"""A taxel is touched if it moves against the others by this many times the noise of the module."""
FIELD_TO_NOISE = 5.0
"""A common field counts from this many times the noise on."""
ROUNDING_NOISE = {"count": 0.3, "N": 1e-6}
"""Noise of rounding, below which a taxel is not compared [unit of the readings]."""
MIN_CHECKED_SAMPLES = 20
"""Samples of a module from which on its health is known."""
ARRIVAL_TIMEOUT, EXTRA_SECONDS = 0.2, 5.0
"""Time for which an arrival, and the last sample of the check, is awaited [s]."""
OPEN_SECONDS = 0.5
"""Time at the start that shows the readings and the noise of the open hand [s]."""
TOUCHED_FROM_START = (
    "{} is touched from the start: open the hand, let nothing touch it, and try again"
)


class ModuleHealth(msgspec.Struct, frozen=True):
    """Health of a module.

    Attributes:
        sensor: its name.
        unit: of the readings.
        n_samples: number of samples.
        rate: samples per second [Hz].
        jitter: standard deviation of the steps in time, without gaps [s].
        n_gaps: number of steps in time of more than three periods.
        noise: (n_taxels, 3) standard deviation from sample to sample [unit].
        dead: numbers of the taxels that never change, from 1.
        stuck: number and axis of the others' axes that never change, as `7 x`.
        n_zeros: number of samples in which a taxel reads zero in all axes, and else does not.
        lowest: least reading [unit].
        highest: largest reading [unit].
        field: largest change that all taxels have in common [unit]; 0 for noise.
    """

    sensor: str
    unit: str
    n_samples: int
    rate: float
    jitter: float
    n_gaps: int
    noise: list[list[float]]
    dead: list[int]
    stuck: list[str]
    n_zeros: int
    lowest: float
    highest: float
    field: float


class HealthCheck(msgspec.Struct, frozen=True):
    """Health of a source at a date.

    Attributes:
        date: YYYY-MM-DD.
        n_lost: number of packets that are missing by the device's own counter.
        modules: health by module.
        touch: module that was touched first, and when [s]; what precedes was checked.
        layout: findings about the layout of the readings.
    """

    date: str
    n_lost: int
    modules: dict[str, ModuleHealth]
    touch: tuple[str, float] | None = None
    layout: tuple[str, ...] = ()


def check_health(source: Source, seconds: float) -> HealthCheck:
    """Read an open source for some time, with the hand open, and return its health.

    Args:
        source: source of the samples; the hand may turn. What follows the first touch is left out.
        seconds: duration [s].

    Raises:
        SourceError: no samples arrive, or too few; or something touches a module from the start.
    """
    if source.metadata.get(STARTS_LOADED):
        raise SourceError(TOUCHED_FROM_START.format(source.name))
    kept: dict[str, list[tuple[float, Array]]] = {name: [] for name in source.sensors}
    n_lost, first, end = 0, None, time.monotonic() + seconds + EXTRA_SECONDS
    while not source.ended and time.monotonic() < end:
        arrival = source.read(ARRIVAL_TIMEOUT)
        if arrival is None or not arrival.samples:
            continue
        first = arrival.time if first is None else first
        if arrival.time - first > seconds:
            break
        n_lost += arrival.n_lost
        for name, readings in arrival.samples.items():
            kept[name].append((arrival.time, np.array(readings, dtype=np.float64)))
    if first is None:
        raise SourceError(f"{source.name} sends no samples")
    touches: list[tuple[float, str]] = []
    arrays = {
        name: (np.array([when for when, _ in samples]), np.array([x for _, x in samples]))
        for name, samples in kept.items()
    }
    for name, (times, readings) in arrays.items():
        if (at := first_touch(name, source.sensors[name], times, readings)) is not None:
            touches.append((float(times[0]) + at, name))
    end, touched = min(touches, default=(math.inf, ""))
    modules, layout = {}, []
    for name, (times, readings) in arrays.items():
        # The means in which the touch was found begin earlier.
        n = int(np.searchsorted(times, end - AVERAGED_SECONDS))
        modules[name] = module_health(name, source.sensors[name], times[:n], readings[:n])
        findings = layout_findings(readings[:n], source.sensors[name], modules[name].unit)
        layout += [f"{name}: {finding.text}" for finding in findings]
    touch = (touched, round(end - first, 1)) if touches else None
    return HealthCheck(date.today().isoformat(), n_lost, modules, touch, tuple(layout))


def module_health(name: str, sensor: Sensor, times: Array, readings: Array) -> ModuleHealth:
    """Return the health of a module from an open hand, which nothing touches.

    Args:
        name: of the module.
        sensor: of the module.
        times: (n,) times of the samples [s].
        readings: (n, n_taxels, 3) readings.

    Raises:
        SourceError: too few samples; or something touched the module.
    """
    if len(times) < MIN_CHECKED_SAMPLES:
        raise SourceError(
            f"{name}: {len(times)} samples given, at least {MIN_CHECKED_SAMPLES} expected"
        )
    valid, lone = _valid(sensor, readings)
    changes = np.diff(valid, axis=0)
    noise = np.sqrt(np.nanmean(changes**2, axis=0) / 2)
    steps = np.diff(times)
    period = float(np.median(steps))
    is_gap = steps > GAP_PERIODS * period
    still = ~(np.nan_to_num(changes) != 0).any(axis=0)
    if sensor.rests_at_zero:
        still &= valid[0] != 0
    usual = _usual_noise(valid)
    moves = _moves(sensor, times, valid, usual, valid)
    if moves.touched.any():
        at = (int(np.argmax(moves.touched)) + 0.5) * moves.period
        raise SourceError(
            f"{name} was touched at {at:.1f} s: open the hand, let nothing touch it, and try again"
        )
    largest = float(moves.field.max()) if sensor.magnetic else 0.0
    least = FIELD_TO_NOISE * _typical(sensor, usual) / np.sqrt(sensor.n_taxels)
    axes = [(i, a) for i, a in np.argwhere(still & ~still.all(axis=1)[:, None]).tolist()]
    return ModuleHealth(
        sensor=sensor.name,
        unit=sensor.unit,
        n_samples=len(times),
        rate=1 / float(np.mean(steps[~is_gap])),
        jitter=float(np.std(steps[~is_gap])),
        n_gaps=int(is_gap.sum()),
        noise=noise.tolist(),
        dead=[taxel_number(i) for i in np.flatnonzero(still.all(axis=1)).tolist()],
        stuck=[f"{taxel_number(i)} {'xyz'[axis]}" for i, axis in axes],
        n_zeros=int(lone.any(axis=1).sum()),
        lowest=float(np.nanmin(valid)),
        highest=float(np.nanmax(valid)),
        field=largest if largest > least else 0.0,
    )


def first_touch(name: str, sensor: Sensor, times: Array, readings: Array) -> float | None:
    """Return when something touches an open module first [s]; None if nothing does.

    Args:
        name: of the module.
        sensor: of the module.
        times: (n,) times of the samples [s].
        readings: (n, n_taxels, 3) readings.

    Raises:
        SourceError: it is touched from the start: too early to check what precedes, or the first
            change lets it go.
    """
    if len(times) < MIN_CHECKED_SAMPLES:
        return None  # `module_health` refuses it
    valid, _ = _valid(sensor, readings)
    n = max(MIN_CHECKED_SAMPLES, int(np.searchsorted(times, times[0] + OPEN_SECONDS)))
    moves = _moves(sensor, times, valid, _usual_noise(valid[:n]), valid[:n])
    if not moves.touched.any():
        return None
    k = int(np.argmax(moves.touched))
    at = (k + 0.5) * moves.period
    pushed = moves.pushed[k]
    n_open = np.searchsorted(times, times[0] + at - AVERAGED_SECONDS)
    if n_open < MIN_CHECKED_SAMPLES or -pushed.min() > pushed.max():
        raise SourceError(TOUCHED_FROM_START.format(name))
    return float(at)


class _Moves(NamedTuple):
    """Changes of the readings of a module, averaged over blocks of a `period` [s].

    Attributes:
        period: of a block [s].
        touched: (n_blocks,) whether a taxel moves against the others.
        pushed: (n_blocks, n_taxels) change of the normal component [unit].
        field: (n_blocks,) size of the change that all taxels have in common [unit].
    """

    period: float
    touched: Flags
    pushed: Array
    field: Array


def _valid(sensor: Sensor, readings: Array) -> tuple[Array, Flags]:
    """Return readings with NaN for lone zeros and what is not finite; and where zeros are lone."""
    zeros = (readings == 0).all(axis=2)
    lone = zeros & ~zeros.all(axis=0) & (not sensor.rests_at_zero)
    return np.where(lone[:, :, None] | ~np.isfinite(readings), np.nan, readings), lone


def _usual_noise(valid: Array) -> Array:
    """Return the noise of each axis from the median step, in which a touch makes none."""
    # The median step of white noise is 1 / 1.05 of its standard deviation.
    return np.asarray(1.05 * np.nanmedian(np.abs(np.diff(valid, axis=0)), axis=0))


def _moves(sensor: Sensor, times: Array, valid: Array, noise: Array, rest: Array) -> _Moves:
    """Return how the taxels move against each other, and together, from the median of `rest`."""
    block = max(1, round(AVERAGED_SECONDS * (len(times) - 1) / float(times[-1] - times[0])))
    n = len(times) // block
    means = np.nanmedian(valid[: n * block].reshape(n, block, *valid.shape[1:]), axis=1)
    moved = means - np.nanmedian(rest, axis=0)
    turned = np.einsum("ijk,nik->nij", sensor.rotations, moved)
    # A field is common in one of two frames (`kernel/field.c`): in that where less is left.
    both = [x - x.mean(axis=1, keepdims=True) for x in (moved, turned)]
    frame = int((both[1] ** 2).sum() < (both[0] ** 2).sum())
    size = np.sqrt(((moved, turned)[frame].mean(axis=1) ** 2).sum(axis=1))
    apart = both[frame] if sensor.magnetic else moved
    # By a tenth, the gains of magnetometers differ: so much of a field is not common.
    limit = TOUCH_TO_NOISE * np.maximum(noise, _typical(sensor, noise)) + 0.1 * size[:, None, None]
    touched = (np.abs(apart) > limit).any(axis=(1, 2))
    period = block / (len(times) - 1) * float(times[-1] - times[0])
    pushed = moved[:, :, 2] - (moved[:, :, 2].mean(axis=1, keepdims=True) if sensor.magnetic else 0)
    return _Moves(period, touched, pushed, size)


def _typical(sensor: Sensor, noise: Array) -> float:
    """Return the noise of a module: a taxel that is far noisier than the others is not touched."""
    return max(float(np.median(noise)), ROUNDING_NOISE[sensor.unit])


def findings_of(check: HealthCheck) -> list[str]:
    """Return what is wrong, one line each."""
    findings = [*check.layout, *([f"{check.n_lost} packets were lost"] if check.n_lost else [])]
    if check.touch is not None:
        findings.append(
            f"{check.touch[0]} was touched at {check.touch[1]} s: only what precedes was checked"
        )
    for name, module in check.modules.items():
        findings += [f"taxel {taxel} of {name} is dead" for taxel in module.dead]
        findings += [
            f"axis {x[-1]} of taxel {x[:-2]} of {name} never changes" for x in module.stuck
        ]
        if module.n_zeros:
            share = 100 * module.n_zeros / module.n_samples
            findings.append(f"{name} reads zeros in one taxel in {share:.2g} % of its samples")
        if len(module.noise) == 1:
            findings.append(f"{name} has one taxel: a field and a touch look the same in it")
    return findings


def table_of(modules: Mapping[str, ModuleHealth]) -> list[tuple[Any, ...]]:
    """Return a row of each module: rate, jitter, gaps, zeros, noise, range and field."""
    rows = []
    for name, x in modules.items():
        noise = np.array(x.noise)
        axes = " ".join(f"{value:.2g}" for value in np.median(noise, axis=0))
        loudest = int(np.argmax((noise**2).sum(axis=1)))
        rows.append((
            name, f"{x.rate:.1f}", f"{1e3 * x.jitter:.2g}", x.n_gaps, x.n_zeros, axes,
            f"{noise[loudest].max():.2g} ({taxel_number(loudest)})",
            f"{x.lowest:.4g} to {x.highest:.4g}", f"{x.field:.3g}",
        ))  # fmt: skip
    return rows
