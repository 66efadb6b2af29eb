"""Make a finger press harder while it is unstable, in a loop without a device.

The loop shows what a controller reads from an estimate. holdfast_grip has grip controllers
with limits, faults and a watchdog: docs/grip.md.
"""

from holdfast import Detector, Model
from holdfast.synthetic import synthetic_recording

STEP, RELAX, MOST = 1.02, 0.999, 2.0
"""Factors of the force per sample, while unstable and otherwise, and the largest force scale."""


def main() -> None:
    """Feed a synthetic grasp sample by sample, and print the largest force scale of a finger."""
    recording = synthetic_recording("grasp", seed=2, fingers=("thumb", "index"))
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    detector = Detector(Model.load("builtin:twin"), sensors)
    scales = dict.fromkeys(sensors, 1.0)
    largest = dict(scales)
    for row, time in enumerate(recording.modules["thumb"].times):
        samples = {name: module.readings[row] for name, module in recording.modules.items()}
        for name, finger in detector.update(samples, time).fingers.items():
            factor = STEP if finger.state == "UNSTABLE" else RELAX
            scales[name] = min(max(scales[name] * factor, 1.0), MOST)
            largest[name] = max(largest[name], scales[name])
    for name, scale in largest.items():
        print(f"{name}: at most {scale:.2f} times its first force")


if __name__ == "__main__":
    main()
