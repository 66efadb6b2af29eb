"""Draw P(slip) of a finger in a grasp before and after calibration, below its speed by the truth.

holdfast calibrate builtin:any 'twin:?seed=3&profile=handling' -o mine.json
python benchmarks/slip_picture.py grasp.parquet builtin:any mine.json -o slip-calibration.png
"""

import argparse
from pathlib import Path

from holdfast.detection import Model, Tare
from holdfast.io import load_recording
from holdfast.metrics.slip_truth import finger_slips
from holdfast.plots.slips import draw_slip_decisions, draw_slip_speed, slip_series
from holdfast.plots.style import add_labels, add_title, page_figure
from holdfast.plots.time_series import finger_series

HEIGHTS = (1.0, 0.8, 0.8)
"""Of the speed, and of P(slip) before and after [inch]."""
SHOWN = (0.005, 0.999)
"""Probabilities that are shown, by their log odds: thresholds are near 1."""


def main(options: argparse.Namespace) -> None:
    recording = load_recording(options.grasp)
    by_slips = {name: len(finger_slips(recording.truth, name)) for name in recording.modules}
    name = max(by_slips, key=by_slips.__getitem__)
    figure = page_figure(sum(HEIGHTS) + 0.4)
    speed, *probabilities = figure.subplots(len(HEIGHTS), 1, sharex=True, height_ratios=HEIGHTS)
    draw_slip_speed(speed, finger_series(recording, name, Tare.parse(0.5)))
    titles = ("before calibration: the threshold is 1", "after: from {:.2f} on")
    for axes, title, path in zip(probabilities, titles, options.models, strict=True):
        decisions = slip_series(Model.load(path), recording)[name]
        draw_slip_decisions(speed, axes, decisions)
        axes.set_yscale("logit")
        axes.set_ylim(*SHOWN)
        axes.set_yticks((0.01, 0.5, 0.99), ("0.01", "0.5", "0.99"))
        axes.minorticks_off()
        add_title(axes, title.format(decisions.threshold))
    speed.set_xlim(*options.seconds)
    add_labels(probabilities[-1], x="time [s]")
    figure.savefig(options.out, dpi=options.dpi)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("grasp", type=Path, help="simulated, with slips")
    parser.add_argument("models", nargs=2, help="before and after")
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, nargs=2, default=(None, None), help="are shown")
    parser.add_argument("--dpi", type=int, default=90)
    main(parser.parse_args())
