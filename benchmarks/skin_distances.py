"""Compare the skin of the twin with real skins: the distribution of every feature, by situation.

    holdfast simulate plain/ --randomize --repeats 48
    holdfast simulate measured/ --randomize --repeats 48 --measured scan,filter,noise,vibration
    python benchmarks/skin_distances.py plain/ measured/ --picture pictures/

The real recordings are those of DATA (`--data`, or HOLDFAST_DATA, or ../shared/data): boxes that
an arm moves, tugs at held objects, and two sets of a GTac gripper. Without folders of the twin a
small set is simulated, 12 hands of each of the two ranges.

The distance is that of Kolmogorov and Smirnov: the largest difference of the two cumulative
distributions, 0 (the same) to 1 (they do not overlap). It does not depend on the scale of a
feature. Situations: the object is held and all is quiet; the arm moves it; a person pushes it and
the finger does not slide; the finger slides. A tug has one label for all of its samples, so the
slip of tugs is mixed with holding; GTac has no labels, and all of it counts as moving.

Prints a table of distances for each feature, means for each family, and how each skin is read
(noise by lag and axis, neighbours, repeated readings). `--picture` writes a page of histograms.
"""

import argparse
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from holdfast.io import save_recording
from holdfast_lab.randomized.drawing import SENSOR_KINDS
from holdfast_lab.randomized.simulation import RandomHold, simulate_random
from holdfast_lab.skin.readout import ReadoutFigures, readout_figures
from holdfast_lab.skin.situations import (
    SITUATIONS,
    Marked,
    distribution_distance,
    real_sets,
    twin_grasps,
    twin_holds,
    values_of,
)

Pools = dict[str, dict[str, np.ndarray]]
"""Values of all fingers, by situation and feature."""

COMPARED = (
    ("boxes", "quiet"), ("boxes", "moving"), ("boxes", "slip"),
    ("tugs", "quiet"), ("tugs", "pushed"), ("tugs", "slip"),
    ("GTac", "moving"), ("GTac V2", "quiet"),
)  # fmt: skip
"""Sets and situations that are compared."""
FROM_OPEN_HAND = "GTac V2"
"""The set that begins with an open hand: it is compared with such recordings of the twin."""
SKIN_MECHANISMS = ("scan", "filter", "noise", "vibration")
"""Mechanisms with which the hands have the same events and stamps as those of the plain twin."""
N_SMALL = 12
FAMILIES = ("any", "A", "B", "C", "D", "txd2", "W9")
COLOURS = ("black", "tab:blue", "tab:orange", "tab:green")


def main(arguments: argparse.Namespace) -> None:
    real = {name: list(marked) for name, marked in real_sets(arguments.data).items()}
    pools = {name: pooled(marked) for name, marked in real.items()}
    with tempfile.TemporaryDirectory() as place:
        folders = arguments.twin or [
            simulated(Path(place), name, mechanisms, arguments.kind)
            for name, mechanisms in (("plain", ()), ("measured", SKIN_MECHANISMS))
        ]
        holds = {folder.name: list(twin_holds(folder, arguments.largest)) for folder in folders}
        grasps = {folder.name: list(twin_grasps(folder, arguments.largest)) for folder in folders}
    twins = {name: (pooled(holds[name]), pooled(grasps[name])) for name in holds}
    table = distances(pools, twins)
    lines = [
        *feature_table(table, list(twins)), "", *family_table(table, list(twins)), "",
        *readout_table(real | {f"twin, {name}": marked for name, marked in holds.items()}),
    ]  # fmt: skip
    print("\n".join(lines))
    if arguments.picture:
        write_pictures(arguments.picture, pools, twins, lines)


def simulated(place: Path, name: str, mechanisms: tuple[str, ...], kind: str | None) -> Path:
    """Simulate a small set of randomized hands, all with one kind of sensor if it is given."""
    folder = place / name
    folder.mkdir()
    for number in range(N_SMALL):
        recording = simulate_random(RandomHold(number, kind=kind, measured=mechanisms))
        save_recording(recording, folder / f"{recording.name}.parquet")
    return folder


def pooled(recordings: Iterable[Marked]) -> Pools:
    """Return the values of all fingers of some recordings."""
    parts: dict[str, dict[str, list[np.ndarray]]] = {name: {} for name in SITUATIONS}
    for marked in recordings:
        for finger in values_of(marked):
            for feature, values in finger.values.items():
                known = values[np.isfinite(values)]
                parts[finger.situation].setdefault(feature, []).append(known)
    return {
        situation: {name: np.concatenate(values) for name, values in features.items()}
        for situation, features in parts.items()
    }


Table = dict[str, dict[tuple[str, str], list[float]]]
"""Distances to each folder of the twin, by feature, set and situation."""


def distances(real: Mapping[str, Pools], twins: Mapping[str, tuple[Pools, Pools]]) -> Table:
    table: Table = {}
    for name, situation in COMPARED:
        for feature, values in real[name][situation].items():
            table.setdefault(feature, {})[name, situation] = [
                distribution_distance(values, twin_values(twin, name, situation, feature))
                for twin in twins.values()
            ]
    return table


def twin_values(twin: tuple[Pools, Pools], name: str, situation: str, feature: str) -> np.ndarray:
    return twin[name == FROM_OPEN_HAND][situation].get(feature, np.empty(0))


def feature_table(table: Table, twins: Sequence[str]) -> Iterator[str]:
    yield f"Distance of each feature from real recordings: {', '.join(twins)}"
    yield ""
    yield f"| feature | {' | '.join(f'{name} {situation}' for name, situation in COMPARED)} |"
    yield f"|---|{'---|' * len(COMPARED)}"
    for feature, row in table.items():
        yield f"| {feature.replace('|', '/')} | {' | '.join(shown(row[c]) for c in COMPARED)} |"


def family_table(table: Table, twins: Sequence[str]) -> Iterator[str]:
    yield f"Mean distance over the features of a family: {', '.join(twins)}"
    yield ""
    yield f"| family | n | {' | '.join(f'{name} {situation}' for name, situation in COMPARED)} |"
    yield f"|---|---|{'---|' * len(COMPARED)}"
    for family in (*FAMILIES, ""):
        rows = [row for name, row in table.items() if name.startswith(family and f"{family} ")]
        means = [np.mean([row[c] for row in rows], axis=0) for c in COMPARED]
        yield f"| {family or 'all'} | {len(rows)} | {' | '.join(map(shown, means))} |"


def shown(values: Iterable[float]) -> str:
    return ", ".join("-" if np.isnan(value) else f"{value:.2f}" for value in values)


def readout_table(sets: Mapping[str, Sequence[Marked]]) -> Iterator[str]:
    yield "How each skin is read, medians over fingers (white noise: 1, 1, 1 and 1.73)"
    yield ""
    yield (
        "| set | fingers | change over 2, 4, 8 samples to 1 | second to first difference "
        "| normal to shear | neighbours x, y, z | taxels 4, 8 apart in number "
        "| samples repeated % | taxels repeated % |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for name, marked in sets.items():
        for situation in ("quiet", "moving", "pushed"):
            figures = readout_figures(marked, situation)
            if figures is not None:
                yield readout_row(f"{name}, {situation}", figures)


def readout_row(title: str, figures: ReadoutFigures) -> str:
    return (
        f"| {title} | {figures.n_fingers} | {shown(figures.by_lag[1:])} | {figures.second:.2f} "
        f"| {figures.normal:.2f} | {shown(figures.neighbours)} | {shown(figures.in_turn)} "
        f"| {100 * figures.repeated:.1f} | {100 * figures.stale:.1f} |"
    )


def write_pictures(
    folder: Path,
    real: Mapping[str, Pools],
    twins: Mapping[str, tuple[Pools, Pools]],
    lines: Sequence[str],
) -> None:
    """Write a picture of each family, and a page with all of them and the tables."""
    folder.mkdir(parents=True, exist_ok=True)
    features = list(real["tugs"]["quiet"])
    for family in FAMILIES:
        names = [name for name in features if name.startswith(f"{family} ")]
        draw_family(folder / f"{family}.png", names, real, twins)
    images = "".join(f'<h2>{name}</h2><img src="{name}.png">' for name in FAMILIES)
    text = "\n".join(lines).replace("&", "&amp;").replace("<", "&lt;")
    page = f"<!doctype html><meta charset=utf-8><title>Skins</title>{images}<pre>{text}</pre>"
    (folder / "index.html").write_text(page, "utf-8")
    print(f"{folder / 'index.html'} written")


def draw_family(
    path: Path,
    features: Sequence[str],
    real: Mapping[str, Pools],
    twins: Mapping[str, tuple[Pools, Pools]],
) -> None:
    """Draw the distributions of a family: a row for each feature, a column for each set."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.4 * len(COMPARED), 1.5 * len(features)), layout="constrained")
    axes = figure.subplots(len(features), len(COMPARED), squeeze=False)
    for row, feature in zip(axes, features, strict=True):
        row[0].set_ylabel(feature, rotation=0, ha="right", fontsize=7)
        for axis, (name, situation) in zip(row, COMPARED, strict=True):
            curves = {"real": real[name][situation][feature]}
            for title, twin in twins.items():
                curves[f"twin, {title}"] = twin_values(twin, name, situation, feature)
            draw_curves(axis, curves)
            axis.set_yticks([])
            axis.tick_params(labelsize=6)
    for axis, (name, situation) in zip(axes[0], COMPARED, strict=True):
        axis.set_title(f"{name}, {situation}", fontsize=8)
    axes[0][0].legend(fontsize=6)
    figure.savefig(path, dpi=80)


def draw_curves(axis, curves: Mapping[str, np.ndarray]) -> None:
    low, high = np.quantile(np.concatenate(list(curves.values())), (0.01, 0.99))
    edges = np.linspace(low, max(high, low + 1e-9), 41)
    for (title, values), colour in zip(curves.items(), COLOURS, strict=False):
        counts = np.histogram(np.clip(values, low, high), edges)[0] / max(len(values), 1)
        axis.stairs(counts, edges, color=colour, label=title, lw=1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("twin", type=Path, nargs="*", help="Folders of randomized hands.")
    default = os.environ.get("HOLDFAST_DATA", "../shared/data")
    parser.add_argument("--data", type=Path, default=Path(default))
    parser.add_argument("--kind", choices=SENSOR_KINDS, help="Sensor of the small set.")
    parser.add_argument("--largest", type=int, help="Maximum number of recordings of a folder.")
    parser.add_argument("--picture", type=Path, help="Folder for a page of pictures.")
    main(parser.parse_args())
