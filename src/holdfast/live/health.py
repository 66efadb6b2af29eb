"""Health of the modules of a hand: what ten seconds of an open hand show, and what has changed."""

import json
import math
import os
import re
import time
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from holdfast.devices.sources import Source, open_source
from holdfast.errors import SourceError
from holdfast.files import read_input, write_whole
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
NOISIER = 3.0
"""Ratio of the noise to that of the last check from which a taxel is reported."""
RATE_CHANGE = 0.05
"""Share by which a rate differs from that of the last check before it is reported."""
ROUNDING_NOISE = {"count": 0.3, "N": 1e-6}
"""Noise below which a taxel is not compared: that of rounding [unit of the readings]."""
MAX_KEPT = 50
"""Number of checks of a source that are kept."""
MAX_HISTORY = 1 << 25
"""Largest file of checks [bytes]; 50 checks of 368 taxels take 1.2 MB."""
MIN_CHECKED_SAMPLES = 20
"""Samples of a module from which on its health is known."""
ARRIVAL_TIMEOUT, EXTRA_SECONDS = 0.2, 5.0
"""Time for which an arrival, and the last sample of the check, is awaited [s]."""
OPEN_SECONDS = 0.5
"""Time at the start that shows the readings and the noise of the open hand [s]."""
TOUCHED_FROM_START = (
    "{} is touched from the start: open the hand, let nothing touch it, and try again"
)
TIMES_IN_WORDS = ("two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


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
        found = layout_findings(readings[:n], source.sensors[name], modules[name].unit)
        layout += [f"{name}: {finding.text}" for finding in found]
    touch = (touched, round(end - first, 1)) if touches else None
    return HealthCheck(date.today().isoformat(), n_lost, modules, touch, tuple(layout))


def check_and_keep(
    uri: str, seconds: float, path: Path
) -> tuple[HealthCheck, HealthCheck | None, list[str]]:
    """Check a source, compare it with the last check that a file keeps, and keep this one.

    Args:
        uri: of the source, or path of a recording.
        seconds: duration of the check [s].
        path: of the file.

    Returns:
        This check, the last one (None if there is none), and what is wrong or has become worse.

    Raises:
        SourceError: as `check_health`; or the file is none of checks.
    """
    earlier = read_history(path)  # a wrong file is refused before a device is awaited
    with open_source(uri, speed=0) as source:
        check = check_health(source, seconds)
    last = earlier[-1] if earlier else None
    findings = [*check.layout, *changes_since(check, last)]
    keep(path, earlier, check)
    return check, last, findings


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


def changes_since(check: HealthCheck, last: HealthCheck | None) -> list[str]:
    """Return what is wrong, and what has become worse since the last check, one line each."""
    found = [f"{check.n_lost} packets were lost"] if check.n_lost else []
    if check.touch is not None:
        found.append(
            f"{check.touch[0]} was touched at {check.touch[1]} s: only what precedes was checked"
        )
    for name, now in check.modules.items():
        found += [f"taxel {taxel} of {name} is dead" for taxel in now.dead]
        found += [f"axis {x[-1]} of taxel {x[:-2]} of {name} never changes" for x in now.stuck]
        if now.n_zeros:
            share = 100 * now.n_zeros / now.n_samples
            found.append(f"{name} reads zeros in one taxel in {share:.2g} % of its samples")
        if len(now.noise) == 1:
            found.append(f"{name} has one taxel: a field and a touch look the same in it")
        then = last.modules.get(name) if last else None
        if last is None or then is None or then.sensor != now.sensor:
            continue
        when = date.fromisoformat(last.date)
        day = f"{when.day} {when:%B}"
        if abs(now.rate - then.rate) > RATE_CHANGE * then.rate:
            found.append(f"{name} sends {now.rate:.4g} Hz, {then.rate:.4g} Hz on {day}")
        levels = [np.sqrt(np.mean(np.square(x.noise), axis=1)) for x in (now, then)]
        for i, (level, before) in enumerate(zip(*levels, strict=False)):
            ratio = level / max(before, ROUNDING_NOISE[now.unit])
            if ratio >= NOISIER:
                whole = round(ratio)
                times = TIMES_IN_WORDS[whole - 2] if whole - 2 < len(TIMES_IN_WORDS) else f"{whole}"
                found.append(
                    f"taxel {taxel_number(i)} of {name} is {times} times noisier than on {day}"
                )
    return found


def history_path(source: str) -> Path:
    """Return the file in which the checks of a source are kept, in the user's state folder."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    name = re.sub(r"[^A-Za-z0-9.-]+", "_", source).strip("_")[-100:]
    return Path(state) / "holdfast" / "health" / f"{name}.json"


def read_history(path: Path) -> list[HealthCheck]:
    """Return the checks that a file keeps, oldest first; none if it does not exist.

    Raises:
        SourceError: the file is none of checks.
    """
    try:
        return msgspec.json.decode(read_input(path, MAX_HISTORY), type=list[HealthCheck])
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as cause:
        why = cause.strerror if isinstance(cause, OSError) else cause
        raise SourceError(f"{path} is no history of checks: {why}; delete it") from cause


def keep(path: Path, history: Sequence[HealthCheck], check: HealthCheck) -> None:
    """Write the history with a new check."""
    path.parent.mkdir(parents=True, exist_ok=True)
    kept = [msgspec.to_builtins(each) for each in [*history, check][-MAX_KEPT:]]
    write_whole(path, json.dumps(kept).encode(), force=True)


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
