"""Draw what faulty and misled magnetic sensors cost, and print what is found in real recordings.

    python benchmarks/faulty_sensors.py --out docs/img    # faulty-sensors.png
    python benchmarks/faulty_sensors.py --data DATA       # a table
    python benchmarks/faulty_sensors.py --laws FOLDER ... # laws of a living skin: two tables
    python benchmarks/faulty_sensors.py --quiet orca-finger --models builtin:any mine.json --seed 7

Before: the detector without what it knows of magnetometers (`Sensor.magnetic`). The readings of the
picture are made: AnySkin at 100 Hz with a noise of 1 uT, pressed with 300 uT.
"""

import argparse
import io
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from holdfast.live.module_checks import HoldDrift, ModuleComparison
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Fault
from holdfast.detection import FingerTrace, Model, detect
from holdfast.io import load_recording
from holdfast.io.importers import import_recordings
from holdfast.plots import COLOURS
from holdfast.plots.style import (
    FONT_SIZE,
    STATE_COLOURS,
    add_labels,
    add_legend,
    add_title,
    panels,
)
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.twin.force_skin import ForceReadout
from holdfast.twin.simulation import Grasp, simulate

Values = npt.NDArray[np.float64]
ANYSKIN, RATE = sensor("anyskin"), 100.0
SHARES = np.array([0.35, 0.8, 1.0, 0.6, 0.2])[:, None]
FIELD = (35.0, -40.0, 30.0)
"""Change of the field by a turn of the hand [uT]."""
SETS = ("uskin_pick_move", "eflesh_slip", "gtac", "gtac_v2")
NAMES = {STABLE: "STABLE", UNSTABLE: "UNSTABLE", NO_CONTACT: "NO_CONTACT", UNKNOWN: "UNKNOWN"}
COLOURS_OF_STATES = STATE_COLOURS | {UNKNOWN: "white"}


def pressed(grip: Values, seed: int = 0) -> Values:
    """Return readings (n, 5, 3) of a press with this course."""
    rng = np.random.default_rng(seed)
    zero = rng.uniform(150, 300, (5, 3)) * rng.choice([-1, 1], (5, 3))
    return zero + grip[:, None, None] * SHARES * [20, 5, 300] + rng.normal(size=(len(grip), 5, 3))


def module(readings: Values) -> Tactile:
    return Tactile(ANYSKIN, np.arange(len(readings)) / RATE, readings)


def without_rules(module: Tactile) -> Tactile:
    """Return a module whose detector has no rules of magnetometers."""
    return replace(module, sensor=replace(module.sensor, magnetic=False))


def traces(modules: Mapping[str, Tactile]) -> tuple[FingerTrace, FingerTrace]:
    """Return the estimates of the first module without the rules of magnetometers, and with."""
    model, name = Model.load("builtin:any"), next(iter(modules))
    others = {name: without_rules(module) for name, module in modules.items()}
    before, after = (detect(model, Recording("made", skins)).fingers for skins in (others, modules))
    return before[name], after[name]


def course(*points: tuple[float, float]) -> Values:
    """Return a course by its corners (time [s], value), to the last."""
    times, values = zip(*points, strict=True)
    return np.interp(np.arange(round(times[-1] * RATE)) / RATE, times, values)


def states_of_faults() -> dict[str, dict[str, Tactile]]:
    """Return the modules of each fault that changes states."""
    grip = course((0, 0), (1.5, 0), (2, 1), (9, 1), (9.4, 0), (12, 0))
    late = course((9, 0), (9.5, 1), (13, 1), (13.4, 0), (15, 0))
    turn = course((3, 0), (5, 1), (15, 1))[:, None, None] * FIELD
    held = course((4, 0), (6, 1), (12, 1))[:, None, None] * FIELD
    zeros, stuck, rng = pressed(grip, 3), pressed(grip, 4), np.random.default_rng(13)
    zeros[np.arange(31, 1200, 40), rng.integers(5, size=30)] = 0
    stuck[300:, 2, 1] = stuck[300, 2, 1]
    palm = pressed(0 * grip, 6) + np.roll(held, 1, axis=2)
    return {
        "the open hand turns from 3 to 5 s": {"a": module(pressed(late, 1) + turn)},
        "it turns while it holds; an open palm shows it": {
            "a": module(pressed(grip, 2) + held), "palm": module(palm),
        },
        "a magnetometer reads zeros, in one row of 40": {"a": module(zeros)},
        "one axis of a taxel is stuck from 3 s on": {"a": module(stuck)},
    }  # fmt: skip


def draw_states(axes: Axes, modules: Mapping[str, Tactile]) -> None:
    before, after = traces(modules)
    top = float(np.nanmax(np.linalg.norm(before.force, axis=1)))
    for k, (trace, colour) in enumerate(((before, COLOURS[1]), (after, COLOURS[0]))):
        axes.plot(trace.times, np.linalg.norm(trace.force, axis=1), color=colour, linewidth=0.8)
        low = -(0.18 + 0.2 * k) * top
        for state, shade in COLOURS_OF_STATES.items():
            axes.fill_between(
                trace.times, low, low - 0.14 * top, where=trace.state == state, color=shade,
                linewidth=0, step="mid",
            )  # fmt: skip
        axes.text(
            -0.015, low - 0.07 * top, ("before", "after")[k], ha="right", va="center",
            fontsize=FONT_SIZE - 1.5, transform=axes.get_yaxis_transform(),
        )  # fmt: skip
    faulty = after.times[after.faults != 0]
    axes.plot(faulty, np.full(len(faulty), -0.6 * top), "|", color="#bb0000", markersize=4)
    axes.set_ylim(-0.7 * top, 1.1 * top)
    axes.set_yticks([y for y in axes.get_yticks() if 0 <= y <= top])
    add_labels(axes, "time [s]", "force [µT]")


def draw_notice(axes: Axes, modules: Mapping[str, Values], notice: str) -> None:
    """Draw the forces of modules, and what is said about them."""
    for (name, readings), colour in zip(modules.items(), (COLOURS[0], COLOURS[5]), strict=False):
        force = np.linalg.norm((readings - readings[:50].mean(axis=0)).sum(axis=1), axis=1)
        style = "-" if colour == COLOURS[0] else (0, (3, 2))
        times = np.arange(len(force)) / RATE
        axes.plot(times, force, color=colour, linewidth=0.8, linestyle=style, label=name)
    axes.set_ylim(0, 1.9 * max(axes.get_ylim()))
    text = "before: no finding\nafter: " + "\n".join(textwrap.wrap(notice, 58))
    axes.text(0.02, 0.97, text, transform=axes.transAxes, va="top", fontsize=FONT_SIZE - 1)
    axes.legend(fontsize=FONT_SIZE - 1, frameon=False, loc="lower right")
    add_labels(axes, "time [s]", "force [µT]")


def likeness_of(modules: Mapping[str, Values]) -> str:
    comparison, n = ModuleComparison(), len(next(iter(modules.values())))
    alike = [
        f"{x.module} {x.text}"
        for k in range(0, n, 5)
        for x in comparison.update({name: rows[k] for name, rows in modules.items()}, k / RATE)
    ]
    return alike[0]


def notices() -> dict[str, tuple[dict[str, Values], str]]:
    """Return modules and what is said about them, by fault."""
    grip = course((0, 0), (1.5, 0), (2, 1), (9, 1), (9.4, 0), (12, 0))
    long = course((0, 0), (2, 0), (3, 1), (70, 0.9), (72, 0.9))
    press, noise = pressed(grip, 7), pressed(0 * grip, 8)
    drifting, drift = pressed(long, 9), HoldDrift()
    for k in range(0, len(drifting), 5):
        drift.update((drifting[k] - drifting[:50].mean(axis=0)).sum(axis=0), k / RATE)
    text = f"drift {drift.per_minute:.3g} µT a minute, in info and as a notice after a minute"
    talk = {"left": press, "right": noise + 0.12 * (press - press[:50].mean(axis=0))}
    copies = {"left": press, "right": press.copy()}
    return {
        "the skin warms or creeps": ({"index": drifting}, text),
        "a module shows a share of the load of another": (talk, likeness_of(talk)),
        "one sensor is read twice": (copies, likeness_of(copies)),
    }


def save(figure: Figure, path: Path) -> None:
    file = io.BytesIO()
    figure.savefig(file, dpi=130, format="png")
    Image.open(file).quantize(64).save(path, optimize=True)  # a third of the size


def draw(path: Path) -> None:
    """Draw one panel of each fault."""
    figure, grid = panels(7, 2, 1.75)
    for axes, (title, modules) in zip(grid, states_of_faults().items(), strict=False):
        add_title(axes, title)
        draw_states(axes, modules)
    for axes, (title, (values, notice)) in zip(grid[4:], notices().items(), strict=True):
        add_title(axes, title)
        draw_notice(axes, values, notice)
    handles = [
        Patch(facecolor=COLOURS_OF_STATES[x], edgecolor="#999999", linewidth=0.4, label=NAMES[x])
        for x in NAMES
    ]
    handles += [
        Patch(color=COLOURS[1], label="force before"), Patch(color=COLOURS[0], label="force after"),
        Patch(color="#bb0000", label="a fault is named"),
    ]  # fmt: skip
    add_legend(figure, handles, per_row=4)
    save(figure, path)


def print_table(data: Path) -> None:
    """Print the states of real recordings before and after, and the share of the two faults."""
    states = " | ".join(f"{name} [%]" for name in NAMES.values())
    print(f"| set | modules | samples | | {states} | field [%] | invalid [%] |")
    model, bits = (
        Model.load("builtin:any"),
        [list(Fault).index(x) for x in (Fault.FIELD, Fault.INVALID)],
    )
    for name in SETS:
        recordings = list(import_recordings(data / name))
        for title in ("before", "after"):
            states, faults, n_modules = np.zeros(4), np.zeros(2), 0
            for recording in recordings:
                modules = recording.modules
                if title == "before":
                    modules = {n: without_rules(m) for n, m in modules.items()}
                for trace in detect(model, replace(recording, modules=modules)).fingers.values():
                    states += np.bincount(trace.state, minlength=4)
                    faults += [(trace.faults >> bit & 1).sum() for bit in bits]
                    n_modules += 1
            n = states.sum()
            shares = " | ".join(f"{100 * x / n:.2f}" for x in (*states[list(NAMES)], *faults))
            print(f"| `{name}` | {n_modules} | {n:.0f} | {title} | {shares} |")


RELEASE_TIME = 0.5
"""After the last touch, a finger is NO_CONTACT [s]."""
LAWS = (Fault.REPEATED, Fault.EQUAL_TAXELS, Fault.STUCK, Fault.COPIED)


def recordings_of(folder: Path) -> Iterator[Recording]:
    """Yield our recordings of a folder, or those of other programs."""
    paths = sorted(folder.glob("*.parquet"))
    yield from map(load_recording, paths) if paths else import_recordings(folder)


def release(recording: Recording, finger: str) -> float:
    """Return when a finger that began open leaves its object for good [s]; else inf."""
    if recording.truth is None or finger not in recording.truth.fingers:
        return np.inf
    touches = recording.truth.fingers[finger]["contact_force"].any(axis=1)
    times = recording.truth.times
    last = np.flatnonzero(touches)[-1] if touches.any() and not touches[0] else len(times) - 1
    return float(times[last]) if times[-1] - times[last] > RELEASE_TIME else np.inf


def print_healthy(folders: Sequence[Path]) -> None:
    """Print how often each law fires on recordings of healthy skins, by sensor and profile.

    A release stays if a sample is not NO_CONTACT `RELEASE_TIME` after the last touch or later.
    """
    rows: dict[tuple[str, str], Values] = {}
    model = Model.load("builtin:any")
    for recording in (path for folder in folders for path in recordings_of(folder)):
        profile = str(recording.metadata.get("profile", "real"))
        for name, trace in detect(model, recording).fingers.items():
            bits = [trace.faults >> list(Fault).index(law) & 1 for law in LAWS]
            alarms = [(np.diff(bit, prepend=0) == 1).sum() for bit in bits]
            minutes = (trace.times[-1] - trace.times[0]) / 60
            released = release(recording, name)
            stays = (trace.state[trace.times > released + RELEASE_TIME] != NO_CONTACT).any()
            if stays:
                print(f"stays: {recording.name} {name}", file=sys.stderr)
            row = rows.setdefault(
                (recording.modules[name].sensor.name, profile), np.zeros(5 + len(LAWS))
            )
            unknown = (trace.state == UNKNOWN).sum()
            row += [minutes, len(trace.state), unknown, np.isfinite(released), stays, *alarms]
    print(f"| sensor | profile | minutes | {' | '.join(LAWS)} | UNKNOWN [%] | releases | stay |")
    for (name, profile), (minutes, n, n_unknown, releases, stays, *alarms) in sorted(rows.items()):
        counts = " | ".join(f"{x:.0f}" for x in alarms)
        ends = f"{100 * n_unknown / n:.2f} | {releases:.0f} | {stays:.0f}"
        print(f"| `{name}` | {profile} | {minutes:.1f} | {counts} | {ends} |")


def broken(readings: Values, start: int, digit: float) -> dict[str, tuple[Fault, Values]]:
    """Return readings (n, n_taxels, 3) that break each law from a sample on."""
    n, rng = len(readings) - start, np.random.default_rng(0)
    busiest = np.argsort((np.diff(readings[start:], axis=0) != 0).any(axis=2).sum(axis=0))
    first, second = busiest[-2:]
    toggles = digit * rng.integers(0, 2, n)
    cases = {}
    for period in (10, 65, 300, 512):
        made = readings.copy()
        made[start:] = readings[start + np.arange(n) % period]
        cases[f"ring of {period}"] = Fault.REPEATED, made
        toggling = made.copy()
        toggling[start:, first, 2] += toggles
        cases[f"the same, one taxel toggles ({period})"] = Fault.REPEATED, toggling
    for title, fault, taxels, axes, value in (
        ("two equal taxels", Fault.EQUAL_TAXELS, first, slice(None), readings[start:, second]),
        ("x frozen", Fault.STUCK, slice(None), 0, readings[start, :, 0]),
        ("x equals y", Fault.STUCK, slice(None), 0, readings[start:, :, 1]),
    ):
        made = readings.copy()
        made[start:, taxels, axes] = value
        cases[title] = fault, made
    made = readings.copy()
    made[start:] = readings[start]
    made[start:, :, 2] += toggles[:, None]
    cases["all frozen, last bit toggles"] = Fault.STUCK, made
    return cases


def print_broken(recordings: Sequence[Recording], start: float) -> None:
    """Print the time from a fault to its detection, and what is STABLE after it and without it.

    Of two equal taxels, one may be left out as a jump that stays, which hides the law.
    """
    print("| sensor | fault | found after [samples] | [s] | STABLE after it [%] | without it |")
    model = Model.load("builtin:any")
    for recording in recordings:
        name, module = next(iter(recording.modules.items()))
        readings = module.readings.astype(np.float64)
        k = int(np.searchsorted(module.times, module.times[0] + start))
        if k + 600 > len(readings):
            continue
        clean = detect(model, Recording("clean", {name: module})).fingers[name]
        noise = np.abs(np.diff(readings[:k], axis=0)).mean()
        for title, (law, values) in broken(readings, k, module.sensor.step or noise / 50).items():
            made = Recording("made", {name: replace(module, readings=values)})
            trace = detect(model, made).fingers[name]
            bits = [trace.faults >> list(Fault).index(x) & 1 for x in (law, Fault.INVALID)]
            first = k + np.flatnonzero(max(bits, key=lambda bit: bit[k:].sum())[k:])
            row = "- | - | - | -"
            if len(first):
                at = first[0]
                after, without = (100 * (x.state[at:] == STABLE).mean() for x in (trace, clean))
                seconds = trace.times[at] - trace.times[k]
                row = f"{at - k} | {seconds:.2f} | {after:.0f} | {without:.0f}"
            print(f"| `{module.sensor.name}` | {title} | {row} |")


def quiet_recordings(name: str, seed: int) -> Iterator[tuple[Recording, npt.NDArray[np.bool_]]]:
    """Yield ten minutes of an open hand, and of a hold without jerks in two parts; and its time."""
    times = np.arange(600 * 100) / 100
    readout = ForceReadout(sensor(name), np.random.default_rng(seed))
    readings = readout.read(np.zeros((len(times), sensor(name).n_taxels, 3)), times)
    open_hand = Recording("open", {"index": Tactile(sensor(name), times, readings)})
    yield open_hand, np.ones(len(times), bool)
    for item in ("can", "box"):
        grasp = Grasp(item, 1, 1, "long-hold", seed, glitch_rate=0.0, sensor=name)
        recording = simulate(grasp)
        times = recording.truth.times
        locked = recording.truth.hand["phase"] == "locked"
        yield recording, locked & (times > times[locked][0] + 1)


def print_quiet(name: str, models: Sequence[str], seed: int) -> None:
    """Print alarms and faults of an open hand and of a quiet hold, all fingers together."""
    print("| sensor | hand | model | minutes | rises to UNSTABLE | samples with a fault |")
    for recording, quiet in quiet_recordings(name, seed):
        for model in models:
            n_rises = n_faulty = 0
            for trace in detect(Model.load(model), recording).fingers.values():
                unstable = (trace.state == UNSTABLE) & quiet
                n_rises += int((np.diff(unstable, prepend=False) & unstable & quiet).sum())
                n_faulty += int((trace.faults[quiet] != 0).sum())
            minutes = np.diff(trace.times)[quiet[1:]].sum() / 60
            row = f"{recording.name} | {model} | {minutes:.1f} | {n_rises} | {n_faulty}"
            print(f"| `{name}` | {row} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for the picture")
    parser.add_argument("--data", type=Path, help="folder with the real recordings")
    parser.add_argument("--laws", type=Path, nargs="+", help="folders with healthy recordings")
    parser.add_argument("--start", type=float, default=8.0, help="of a fault [s]")
    parser.add_argument("--quiet", nargs="+", default=[], help="sensors with steps, by the twin")
    parser.add_argument("--models", nargs="+", default=["builtin:any"], help="of --quiet")
    parser.add_argument("--seed", type=int, default=7, help="of --quiet")
    options = parser.parse_args()
    for name in options.quiet:
        print_quiet(name, options.models, options.seed)
    if options.laws:
        print_healthy(options.laws)
        firsts = (next(recordings_of(folder)) for folder in options.laws)
        print_broken(list(firsts), options.start)
    if options.out:
        draw(options.out / "faulty-sensors.png")
    if options.data:
        print_table(options.data)


if __name__ == "__main__":
    main()
