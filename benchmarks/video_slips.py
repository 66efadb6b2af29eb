"""Slips that a webcam of the twin sees, against the truth: the table of docs/label-by-camera.md.

holdfast simulate filmed/ --seed 7 --profile slips --cases 2 --repeats 1 --video
python benchmarks/video_slips.py filmed/
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np

from holdfast.contact import HELD_PHASES
from holdfast.errors import RecordingError
from holdfast.io import load_dataset
from holdfast.io.foreign import end_children
from holdfast.labelling.rules import propose, video
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_truth import finger_slips
from holdfast.twin.webcam import clock_shift

DELAY = 0.010
"""From the stamp of a picture to the middle of its exposure, in its middle row [s]."""
VISIBLE_SLID = 0.05
"""Distance from which a slip is visible, for the second line [mm]."""


def slid(recording, finger):
    """Return the distance that a held finger has slid, (n,) [mm]."""
    truth = recording.truth
    held = np.isin(truth.hand["phase"].astype(str), [phase.value for phase in HELD_PHASES])
    return 1e3 * np.cumsum(truth.fingers[finger]["slip_speed"] * held) * np.diff(truth.times[:2])


def compare(recording, labels, rows):
    """Add the slips over 0.3 mm, and the disturbances in which nothing slides."""
    times = recording.truth.times
    disturbed = recording.truth.hand["phase"].astype(str) == "disturbed"
    for finger, found in labels.items():
        seen = [label for label in found if label.cause == "slip"]
        onsets = np.array([label.start for label in seen])
        total = slid(recording, finger)
        for slip in finger_slips(recording.truth, finger):
            if slip.distance < 3e-4:
                continue
            first = max(np.searchsorted(times, slip.onset) - 1, 0)
            visible = times[
                min(np.searchsorted(total, total[first] + VISIBLE_SLID), len(times) - 1)
            ]
            near = onsets[(onsets > slip.onset - 0.15) & (onsets < min(slip.end, slip.onset + 0.5))]
            rows["onset"].append(min(np.abs(near - slip.onset), default=np.inf))
            rows["visible"].append(min(np.abs(near - visible), default=np.inf))
            if slip.distance > 1e-3 and len(near):
                parts = [x for x in seen if x.start < slip.end + 0.05 and x.end > slip.onset - 0.05]
                distance = sum(float(part.evidence.split()[1]) for part in parts)
                rows["distance"].append(abs(distance - 1e3 * slip.distance))
        for first, last in runs(disturbed):
            around = slice(max(first - 15, 0), last + 15)
            if last - first > 10 and np.ptp(total[around]) < 0.03:
                span = times[around]
                rows["false"].append(bool(((onsets > span[0]) & (onsets < span[-1])).any()))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    rows = {name: [] for name in ("onset", "visible", "distance", "false", "clock", "seconds")}
    refused = 0
    start, used = time.monotonic(), sum(os.times()[:4])
    dataset = load_dataset(folder)
    clocks, whole = [], video.video_clock

    def measured_clock(recording, *rest):
        clocks.append(whole(recording, *rest))
        return clocks[-1]

    video.video_clock = measured_clock
    for path, recording in zip(dataset.paths, dataset, strict=True):
        rows["seconds"].append(recording.end - recording.start)
        try:
            labels = propose("tracking", recording, video=path.with_suffix(".mp4"))
        except RecordingError as cause:
            refused += 1
            print(cause)
            continue
        rows["clock"].append(abs(clocks[-1].offset - clock_shift(recording) - DELAY))
        compare(recording, labels, rows)
    end_children()  # its time counts from its end
    used = sum(os.times()[:4]) - used
    n, total = len(rows["onset"]), sum(rows["seconds"])
    print(f"{len(dataset.paths)} recordings, {refused} refused, {n} slips over 0.3 mm")
    for name in ("onset", "visible"):
        shares = [100 * np.mean(np.array(rows[name]) <= limit) for limit in (0.025, 0.05, 0.1)]
        print(f"{name:8} within 25, 50, 100 ms: {shares[0]:.0f} {shares[1]:.0f} {shares[2]:.0f} %")
    print(f"false in {100 * np.mean(rows['false']):.1f} % of {len(rows['false'])} disturbances")
    print(f"distance: median error {np.median(rows['distance']):.2f} mm of {len(rows['distance'])}")
    print(f"offset of the clocks: largest error {1e3 * max(rows['clock']):.1f} ms")
    print(
        f"processor {used:.0f} s for {total:.0f} s of video: {total / used:.1f} times real time on "
        f"one core ({time.monotonic() - start:.0f} s passed)"
    )


if __name__ == "__main__":
    main()
