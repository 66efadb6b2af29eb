"""Figures of sensors and hands: positions and normals of the taxels."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

from holdfast.plots.style import PageFigure, default_settings, literal
from holdfast.sensors import Hand, Sensor, taxel_number
from holdfast.sensors.types import Array

MM_PER_M = 1e3
MIN_HEIGHT_RANGE = 1e-3
"""A sensor whose taxel heights differ by less is drawn as flat [mm]."""

AXIS_COLOURS = ("#c0392b", "#2e8b57", "#2b5ea8")
PART_COLOURS = {
    "thumb": "#b3476b",
    "index": "#d1813c",
    "middle": "#4a8f5c",
    "ring": "#3a78b0",
    "palm": "#77788a",
}


@default_settings()
def plot_sensor(sensor: Sensor) -> Figure:
    """Draw the taxels of a sensor in space with their normals, and numbered from outside."""
    figure = PageFigure(figsize=(8.2, 4.2), dpi=160, layout="constrained")
    unit = "counts" if sensor.unit == "count" else "newtons"
    figure.suptitle(
        f"{literal(sensor.name)}: {sensor.n_taxels} taxels, {sensor.rate:g} Hz, readings in {unit}",
        fontsize=10,
    )
    # Right and up in a view from outside, along the normal; up is distal where z is not the normal.
    axis = np.array([0.0, 0.0, 1.0]) if abs(sensor.normal[2]) < 0.7 else np.array([0.0, 1.0, 0.0])
    right = np.cross(axis, sensor.normal)
    right /= np.linalg.norm(right)
    up = np.cross(sensor.normal, right)
    height = sensor.positions @ sensor.normal * MM_PER_M
    low, high = float(height.min()), float(height.max())
    margin = 0.1 * (high - low) if high - low > MIN_HEIGHT_RANGE else 1.0  # flat: one colour
    scale = ScalarMappable(Normalize(low - margin, high + margin), "viridis")
    colours: Array = scale.to_rgba(height)
    _draw_space(figure.add_subplot(1, 2, 1, projection="3d"), sensor, colours, up)
    front = figure.add_subplot(1, 2, 2)
    _draw_front(front, sensor, colours, (right, up))
    if np.ptp(height) > MIN_HEIGHT_RANGE:
        bar = figure.colorbar(scale, ax=front, shrink=0.6, aspect=25)
        bar.set_label(f"{_axis_name(sensor.normal)} [mm]", fontsize=7)
        bar.ax.tick_params(labelsize=6)
    return figure


@default_settings()
def plot_noise(noise: Mapping[str, npt.ArrayLike]) -> Figure:
    """Draw the noise of each taxel and axis, (n_taxels, 3) by module, one panel a module."""
    figure = PageFigure(figsize=(7.2, 0.4 + 1.4 * len(noise)), dpi=160, layout="constrained")
    panels = figure.subplots(len(noise), 1, squeeze=False)[:, 0]
    for axes, (name, values) in zip(panels, noise.items(), strict=True):
        levels = np.asarray(values, dtype=np.float64)
        numbers = np.arange(len(levels))
        for axis, colour in enumerate(AXIS_COLOURS):
            x = numbers + 0.27 * (axis - 1)
            axes.bar(x, levels[:, axis], 0.25, color=colour, label="xyz"[axis])
        axes.set_title(literal(name), fontsize=8, loc="left")
        axes.set_xticks(numbers, [str(taxel_number(i)) for i in numbers.tolist()], fontsize=6)
        axes.tick_params(axis="y", labelsize=6)
        axes.set_ylabel("noise", fontsize=7)
    panels[0].legend(fontsize=6, ncols=3, frameon=False, loc="lower right", bbox_to_anchor=(1, 1))
    panels[-1].set_xlabel("taxel", fontsize=7)
    return figure


@default_settings()
def plot_hand(hand: Hand) -> Figure:
    """Draw the flat map of a hand: every taxel with its number, coloured by finger."""
    cells = np.concatenate([module.grid for module in hand.modules.values()])
    n_rows, n_columns = cells.max(axis=0) + 1
    figure = PageFigure(figsize=(0.3 * n_columns + 0.6, 0.3 * n_rows + 0.6), dpi=160)
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.96))
    axes.set_title(
        f"{literal(hand.name)}: {hand.n_taxels} taxels in {len(hand.modules)} modules, numbered in "
        "each module",
        fontsize=8,
    )
    for name, module in hand.modules.items():
        colour = PART_COLOURS.get(name.split("/", maxsplit=1)[0], "#777777")
        # Fingertips stand out against the pads of the same finger.
        strength = 0.55 if "/" not in name else 0.28
        for k, (row, column) in enumerate(module.grid):
            cell = FancyBboxPatch(
                (column + 0.1, row + 0.1), 0.8, 0.8, boxstyle="round,pad=0,rounding_size=0.2",
                facecolor=(colour, strength), edgecolor=colour, linewidth=0.6,
            )  # fmt: skip
            axes.add_patch(cell)
            number = str(taxel_number(k))
            axes.text(column + 0.5, row + 0.52, number, ha="center", va="center", fontsize=4.6)
        (top, left), (_, right) = module.grid.min(axis=0), module.grid.max(axis=0)
        axes.text(
            (left + right + 1) / 2, top - 0.12, literal(name),
            ha="center", va="bottom", fontsize=6.5, color=colour, fontweight="bold",
        )  # fmt: skip
    axes.set_xlim(-1.1, n_columns + 0.1)
    axes.set_ylim(n_rows + 0.1, -1.1)
    axes.set_aspect("equal")
    axes.axis("off")
    return figure


def _draw_space(axes: Axes3D, sensor: Sensor, colours: Array, up: Array) -> None:
    points = sensor.positions * MM_PER_M
    size = float(np.ptp(points, axis=0).max()) or 10.0
    normals = sensor.rotations[:, :, 2] * 0.16 * size
    drawn = np.vstack([points, points + normals, np.zeros(3), np.full(3, 0.36 * size)])
    axes.scatter(*points.T, c=colours, s=22, depthshade=False, edgecolors="black", linewidths=0.4)
    axes.quiver(*points.T, *normals.T, color="#444444", linewidth=0.8, arrow_length_ratio=0.3)
    for axis, (name, colour) in enumerate(zip("xyz", AXIS_COLOURS, strict=True)):
        arrow = np.zeros(3)
        arrow[axis] = 0.3 * size
        axes.quiver(0, 0, 0, *arrow, color=colour, linewidth=1.6, arrow_length_ratio=0.2)
        axes.text(*(1.2 * arrow), name, color=colour, fontsize=8, ha="center", va="center")
    # One scale for all axes, with room for all that is drawn, from any side.
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_proj_type("ortho")
    axes.set_box_aspect(high - low, zoom=0.95)
    axes.set_axis_off()
    # From outside, slightly above and beside the normal: along it, normals would be points.
    eye = sensor.normal + 0.6 * np.cross(up, sensor.normal) + 0.45 * up
    elevation = np.degrees(np.arcsin(eye[2] / np.linalg.norm(eye)))
    axes.view_init(elev=elevation, azim=np.degrees(np.arctan2(eye[1], eye[0])))


def _draw_front(axes: Axes, sensor: Sensor, colours: Array, view: tuple[Array, Array]) -> None:
    points = sensor.positions @ np.transpose(view) * MM_PER_M
    size = float(np.ptp(points, axis=0).max()) or 10.0
    for axis, length, colour in ((2, 0.13, "#444444"), (0, 0.07, AXIS_COLOURS[0])):
        arrows = sensor.rotations[:, :, axis] @ np.transpose(view) * length * size
        axes.quiver(
            *points.T, *arrows.T, angles="xy", scale_units="xy", scale=1, width=0.004, color=colour
        )
    axes.scatter(
        points[:, 0], points[:, 1], c=colours, s=130, edgecolors="black", linewidths=0.6, zorder=2
    )
    for k, (x, y) in enumerate(points):
        # Numbers are readable on dark and on light colours.
        ink = "white" if colours[k, :3].mean() < 0.55 else "black"
        axes.text(x, y, str(taxel_number(k)), ha="center", va="center", fontsize=6.5, color=ink)
    right, up = view
    axes.set_aspect("equal")
    axes.margins(0.16)
    axes.set_xlabel(f"{_axis_name(right)} [mm]", fontsize=7)
    axes.set_ylabel(f"{_axis_name(up)} [mm]", fontsize=7)
    axes.tick_params(labelsize=6)
    axes.set_title("seen from outside: taxel z grey, taxel x red", fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _axis_name(direction: Array) -> str:
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) < 0.999:
        return "({:.2f}, {:.2f}, {:.2f})".format(*direction)
    return ("" if direction[axis] > 0 else "-") + "xyz"[axis]
