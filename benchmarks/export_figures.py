"""Draw the pictures of docs/export.md from files that `holdfast export` wrote of real recordings.

    holdfast import "$HOLDFAST_DATA/uskin_pick_move" box
    holdfast export box dataset --format lerobot
    holdfast export box view --format foxglove --model builtin:any
    holdfast export box tables --format csv
    python benchmarks/export_figures.py dataset view tables --out docs/img

Only the written files are read: the data set by pyarrow, the scene by the `mcap` library.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mcap.reader import make_reader

from holdfast.contact import STABLE, UNSTABLE
from holdfast.plots.style import (
    COLOURS,
    STATE_COLOURS,
    add_labels,
    add_legend,
    add_title,
    page_figure,
    style_axes,
)
from holdfast_interop.lerobot.layout import DATA_PATH, INFO_PATH
from holdfast_lab.report.images import png_of

EPISODE = 3
"""The recording in the pictures, `data_sample_2022-02-22-08-10-01`: a box slips and is lost."""
SCENE_TIME = 2.98
"""Time of the arrows in the picture [s]."""
LABEL_COLOURS = {2: STATE_COLOURS[UNSTABLE], 3: STATE_COLOURS[STABLE]}
"""Colour of the labels of a data set that are shown."""
N_LINES, N_LETTERS = 9, 108
"""Part of a table that fits on the picture of a terminal."""
TERMINAL_COLOURS = {"face": "#1e1e1e", "text": "#d4d4d4"}

Values = npt.NDArray[np.float64]


def column(path: Path, name: str) -> Values:
    """Return a column of the frames of the episode as an array."""
    table = pq.read_table(path / DATA_PATH.format(chunk_index=0, file_index=0))
    rows = table.filter(np.array(table.column("episode_index")) == EPISODE)
    return np.array(rows.column(name).to_pylist())


def draw_data_set(path: Path) -> Figure:
    """Draw a module of an episode: taxels by frame, and the window of one frame."""
    name = "observation.tactile.finger1"
    fps = json.loads((path / INFO_PATH).read_text())["fps"]
    windows = column(path, name)
    labels, new = column(path, "label.finger1"), column(path, f"{name}.new")
    seconds = np.arange(len(windows)) / fps
    figure = page_figure(2.9)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for axes in (upper, lower):
        style_axes(axes)
    change = windows[:, -1, :, 2] - windows[0, -1, :, 2]
    image = upper.pcolormesh(seconds, np.arange(1, 17), change.T, cmap="RdBu_r", rasterized=True)
    image.set_clim(-abs(change).max(), abs(change).max())
    upper.set_yticks((1, 4, 8, 12, 16))
    bar = figure.colorbar(image, ax=upper, pad=0.01)
    bar.set_label("change [count]", fontsize=7)
    bar.ax.tick_params(labelsize=7)
    add_title(upper, f"{name}: the newest sample of each frame, z")
    add_labels(upper, y="taxel")
    for label, colour in LABEL_COLOURS.items():
        lower.bar(seconds, new * (labels == label), width=0.8 / fps, color=colour)
    lower.bar(seconds, new * ~np.isin(labels, list(LABEL_COLOURS)), width=0.8 / fps, color="#bbb")
    add_title(lower, f"{name}.new, and label.finger1: green stable, orange unstable")
    add_labels(lower, f"time [s], {fps} frames a second", "samples")
    return figure


def messages(path: Path, topic: str) -> Iterator[tuple[float, Any]]:
    """Yield the time [s] and the content of the messages of a topic."""
    with path.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages(topics=[topic]):
            yield message.log_time * 1e-9, json.loads(message.data)


def rotated(orientation: Mapping[str, float], vector: Sequence[float]) -> Values:
    """Return a vector turned by a quaternion."""
    x, y, z, w = (orientation[axis] for axis in "xyzw")
    part = np.array([x, y, z])
    twice = 2 * np.cross(part, vector)
    return np.asarray(vector) + w * twice + np.cross(part, twice)


def position(place: Mapping[str, float]) -> Values:
    return np.array([place[axis] for axis in "xyz"])


def draw_scene(axes: Axes, path: Path, time: float) -> None:
    """Draw the taxels, and their arrows at a time, with the frames of the modules."""
    transforms = next(messages(path, "/tf"))[1]["transforms"]
    frames = {t["child_frame_id"]: position(t["translation"]) for t in transforms}
    for entity in next(messages(path, "/holdfast/taxels"))[1]["entities"]:
        for sphere in entity["spheres"]:
            place = frames[entity["frame_id"]] + position(sphere["pose"]["position"])
            axes.scatter(*place * 1e3, s=6, color="#999999")
    _, scene = min(messages(path, "/holdfast/arrows"), key=lambda entry: abs(entry[0] - time))
    for entity in scene["entities"]:
        for arrow in entity["arrows"]:
            start = frames[entity["frame_id"]] + position(arrow["pose"]["position"])
            length = arrow["shaft_length"] + arrow["head_length"]
            step = rotated(arrow["pose"]["orientation"], (length, 0.0, 0.0))
            colour = [arrow["color"][channel] for channel in "rgb"]
            axes.quiver(*start * 1e3, *step * 1e3, color=colour, linewidth=1.2)
    axes.set_zlim(-12, 4)
    axes.set_aspect("equal")
    axes.view_init(elev=22, azim=-65)
    axes.set(xticks=(-20, 0, 20), yticks=(-5, 5), zticks=(-10, 0))
    axes.tick_params(labelsize=5.5, pad=-3)
    axes.set_xlabel("x [mm]", fontsize=7, labelpad=-6)
    add_title(axes, f"/holdfast/arrows at {time:.2f} s")


def draw_scalars(axes: Axes, path: Path, topic: str, label: str) -> list[Line2D]:
    """Draw the values of all fingers on a topic."""
    entries = list(messages(path, topic))
    times = [time for time, _ in entries]
    fingers = [scalar["label"] for scalar in entries[0][1]["scalars"]]
    lines = []
    for k, (finger, colour) in enumerate(zip(fingers, COLOURS, strict=False)):
        values = [content["scalars"][k]["value"] for _, content in entries]
        numbers = [np.nan if value is None else value for value in values]
        lines += axes.plot(times, numbers, color=colour, linewidth=0.9, label=finger)
    style_axes(axes)
    add_title(axes, topic)
    add_labels(axes, y=label)
    return lines


def draw_view(path: Path) -> Figure:
    """Draw what the layout shows: the scene, and plots."""
    figure = page_figure(2.8)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
    draw_scene(figure.add_subplot(grid[:, 0], projection="3d"), path, SCENE_TIME)
    force, probability = (figure.add_subplot(grid[k, 1]) for k in (0, 1))
    lines = draw_scalars(force, path, "/holdfast/force", "count")
    draw_scalars(probability, path, "/holdfast/stable_probability", "")
    for axes in (force, probability):
        axes.axvline(SCENE_TIME, color="#333333", linewidth=0.6, linestyle=":")
    add_labels(probability, "time [s]")
    add_legend(figure, lines)
    return figure


def draw_table(path: Path) -> Figure:
    """Draw the beginning of a table as a terminal shows it."""
    command = f"$ head -n {N_LINES} {path.name} | cut -c-{N_LETTERS}"
    with path.open(encoding="utf-8") as file:
        lines = [line.rstrip("\n")[:N_LETTERS] for line in islice(file, N_LINES)]
    figure = page_figure(0.16 * (len(lines) + 1.6))
    figure.set_facecolor(TERMINAL_COLOURS["face"])
    figure.text(
        0.015, 0.95, "\n".join([command, *lines]), va="top", family="monospace", fontsize=7.4,
        color=TERMINAL_COLOURS["text"], linespacing=1.5, parse_math=False,
    )  # fmt: skip
    return figure


def numbered(folder: Path, suffix: str) -> Path:
    """Return the file of the recording in the pictures."""
    return sorted(folder.glob(f"*{suffix}"))[EPISODE]


def main(arguments: argparse.Namespace) -> None:
    pictures = {
        "export-lerobot.png": draw_data_set(arguments.dataset),
        "export-foxglove.png": draw_view(numbered(arguments.view, ".mcap")),
        "export-csv.png": draw_table(numbered(arguments.tables, ".csv")),
    }
    for name, figure in pictures.items():
        (arguments.out / name).write_bytes(png_of(figure))
        print(arguments.out / name)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for name in ("dataset", "view", "tables"):
        parser.add_argument(name, type=Path, help=f"output of `holdfast export`: {name}")
    parser.add_argument("--out", type=Path, required=True, help="folder of the pictures")
    main(parser.parse_args())
