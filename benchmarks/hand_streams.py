"""Compare the streams of randomized hands with real ones: distributions, twin beside real.

    holdfast simulate before/ --randomize --repeats 48 --measured scan,filter,noise,vibration
    holdfast simulate after/ --randomize --repeats 48 --measured all
    python benchmarks/hand_streams.py before/ after/ --picture streams.png

Noise by time (rms change of a quiet reading over 17 ms to 2 s, over that over 17 ms), noise in
steps of the readings, intervals between rows, share of repeated rows, activity of ordinary
handling, the share of the force's motion in the band of tremor, and the motion over the noise.
The real recordings are those of DATA (`--data`, or HOLDFAST_DATA, or ../shared/data). None of them
is in a person's hand: the tremor of the twin stands beside arms and grippers.

Prints the 10th, 50th and 90th percentile of the fingers of each set. No value here is a score of a
model, except that the activity is measured with the features and the default handling of `--model`.
"""

import argparse
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from holdfast.model import Model
from holdfast_lab.skin.situations import real_sets, twin_grasps, twin_holds
from holdfast_lab.skin.streams import CHANGE_TIMES, FingerStream, finger_streams

SCALARS = ("repeated", "activity", "tremor", "motion")
"""Figures of which a finger has one value."""
SERIES = ("noise_in_steps", "intervals")
"""Figures of which a finger has many values."""
TITLES = {
    "repeated": "rows repeated",
    "activity": "activity of handling",
    "tremor": "share of 8 to 12 Hz in 2 to 12 Hz",
    "motion": "force at 2 to 12 Hz / noise",
    "noise_in_steps": "noise of an axis / step",
    "intervals": "interval / median",
}
LOGARITHMIC = ("noise_in_steps", "motion")
MAX_VALUES = 500
"""Values of one finger that are kept of a figure, evenly spread."""
PERCENTILES = (10, 50, 90)

Streams = Mapping[str, Sequence[FingerStream]]


def main(arguments: argparse.Namespace) -> None:
    model = Model.load(arguments.model)
    sets = {
        name: list(finger_streams(marked, model))
        for name, marked in real_sets(arguments.data).items()
    }
    for folder in arguments.twin:
        for kind, read in (("holds", twin_holds), ("from open", twin_grasps)):
            marked = read(folder, arguments.largest)
            sets[f"twin, {folder.name}, {kind}"] = list(finger_streams(marked, model))
    print("\n".join(table(sets)))
    if arguments.picture:
        draw(arguments.picture, sets)


def table(sets: Streams) -> list[str]:
    figures = [f"change over {1e3 * time:.0f} ms" for time in CHANGE_TIMES[1:]]
    figures += [TITLES[name] for name in (*SERIES, *SCALARS)]
    lines = [f"| set | fingers | {' | '.join(figures)} |", f"|---|{'---|' * (len(figures) + 1)}"]
    for name, streams in sets.items():
        columns = [np.array([x.changes[k] for x in streams]) for k in range(1, len(CHANGE_TIMES))]
        columns += [values_of(streams, figure) for figure in (*SERIES, *SCALARS)]
        cells = " | ".join(shown(column) for column in columns)
        lines.append(f"| {name} | {len(streams)} | {cells} |")
    return lines


def values_of(streams: Sequence[FingerStream], figure: str) -> np.ndarray:
    """Return the values of a figure of all fingers."""
    if figure in SCALARS:
        return np.array([getattr(stream, figure) for stream in streams])
    parts = [getattr(stream, figure) for stream in streams]
    kept = [
        part[np.linspace(0, len(part) - 1, MAX_VALUES).astype(int)] for part in parts if len(part)
    ]
    return np.concatenate([np.sort(part) for part in kept] or [np.empty(0)])


def shown(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    if not len(known):
        return "-"
    return ", ".join(f"{value:.2g}" for value in np.percentile(known, PERCENTILES))


def draw(path: Path, sets: Streams) -> None:
    """Draw noise by time, and a cumulative distribution of each other figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.5), layout="constrained")
    axes = figure.subplots(2, 4).ravel()
    real = [name for name in sets if not name.startswith("twin")]
    twins = [name for name in sets if name.endswith("holds")]
    for name, colour in zip(real, ("black", "dimgray", "darkgray", "silver"), strict=True):
        draw_set(axes, sets[name], name, color=colour, lw=1.2)
    for name, colour in zip(twins, ("tab:blue", "tab:orange", "tab:green"), strict=False):
        draw_set(axes, sets[name], name.removesuffix(", holds"), color=colour, lw=1.8)
    axes[0].set(
        xscale="log", yscale="log", title="change of a quiet reading / over 17 ms", xlabel="s"
    )
    for axis, name in zip(axes[1:], (*SERIES, *SCALARS), strict=False):
        axis.set(title=TITLES[name], ylim=(0, 1), ylabel="share below")
        if name in LOGARITHMIC:
            axis.set_xscale("log")
    axes[2].set_xlim(0, 5)
    axes[-1].axis("off")
    handles, labels = axes[0].get_legend_handles_labels()
    axes[-1].legend(handles, labels, loc="center")
    figure.savefig(path, dpi=90)


def draw_set(axes, streams: Sequence[FingerStream], name: str, **style) -> None:
    changes = np.array([stream.changes for stream in streams])
    known = np.isfinite(changes).any(axis=0)
    middle = np.nanmedian(changes[:, known], axis=0)
    axes[0].plot(np.array(CHANGE_TIMES)[known], middle, ".-", label=name, **style)
    for axis, figure in zip(axes[1:], (*SERIES, *SCALARS), strict=False):
        values = values_of(streams, figure)
        values = np.sort(values[np.isfinite(values)])
        if figure in LOGARITHMIC:
            values = np.maximum(values, 0.05)
        axis.step(values, np.linspace(0, 1, len(values)), **style)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("twin", type=Path, nargs="+", help="Folders of randomized hands.")
    default = os.environ.get("HOLDFAST_DATA", "../shared/data")
    parser.add_argument("--data", type=Path, default=Path(default))
    parser.add_argument("--model", default="builtin:any")
    parser.add_argument("--largest", type=int, help="Maximum number of recordings of a folder.")
    parser.add_argument("--picture", type=Path, help="Picture of the distributions.")
    main(parser.parse_args())
