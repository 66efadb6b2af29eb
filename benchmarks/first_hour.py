"""Do what a new user does in the first hour, and print each command with its time.

    uv run python benchmarks/first_hour.py

Eight tasks of at most three commands. Each command stands in README or in `--help`, or was proposed
by the command before it: `PASTE` is the line that it printed.
"""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from holdfast.synthetic import synthetic_recording

PASTE = "PASTE"
N_SHOWN = 20
"""Number of first and of last lines of a long output that are shown."""
ARRAY = """
import numpy as np
from holdfast import Model, Recording, Tactile, detect

readings = np.load("press.npy")
times = np.arange(len(readings)) / 150
hand = {"thumb": Tactile("uskin-curved", times, readings)}
states = detect("builtin:any", Recording("mine", hand)).to_frame()
print(states.groupby(["finger", "state"]).size())
"""
TASKS: dict[str, list[str]] = {
    "first look": ["holdfast --help", "holdfast doctor"],
    "demo": ["holdfast demo"],
    "own CSV file": [
        "holdfast detect builtin:any press.csv", PASTE + " --summary --plot states.png",
    ],
    "own npz file": ["holdfast import press.npz recordings", PASTE, "holdfast info recordings"],
    "own bag": [
        "holdfast import press-bag bags",
        PASTE,
        "holdfast detect builtin:any bags/press-bag.parquet --summary",
    ],
    "array in Python": ["python array_of_readings.py"],
    "hand": [
        "holdfast doctor twin:",
        "holdfast calibrate builtin:any twin: -o mine.json",
        "holdfast detect mine.json twin:",
    ],
    "page": ["holdfast serve mine.json twin:"],
}  # fmt: skip
STOP_AT = {"detect mine.json twin:": "Ctrl-C stops", "serve": "Ctrl-C stops it"}
"""What a command that goes on prints when it is interrupted here."""


def write_inputs(folder: Path) -> None:
    """Write one recording as CSV, npz, bag and array, and the program that reads the array."""
    module = synthetic_recording("press", 0, ("thumb",)).modules["thumb"]
    times, readings = module.times, module.readings
    rows = np.c_[times, readings.reshape(len(times), -1)]
    names = ["time", *(f"{axis}{k}" for k in range(readings.shape[1]) for axis in "xyz")]
    np.savetxt(folder / "press.csv", rows, delimiter=",", header=",".join(names), comments="")
    np.savez(folder / "press.npz", time=times, readings=readings)
    np.save(folder / "press.npy", readings)
    (folder / "array_of_readings.py").write_text(ARRAY)
    store = get_typestore(Stores.ROS2_HUMBLE)
    layout = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    array = store.types["std_msgs/msg/Float32MultiArray"]
    with Writer(folder / "press-bag", version=9) as bag:
        topic = bag.add_connection("/thumb/tactile", array.__msgtype__, typestore=store)
        for moment, sample in zip(times, readings, strict=True):
            message = array(layout, sample.reshape(-1).astype(np.float32))
            data = store.serialize_cdr(message, array.__msgtype__)
            bag.write(topic, int(1e18 + 1e9 * moment), data)


def run(command: str, folder: Path) -> tuple[str, int, float]:
    """Run a command as a person does; return what it printed, its exit code and its time [s]."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    stop = next((text for words, text in STOP_AT.items() if words in command), None)
    begin, printed = time.perf_counter(), ""
    process = subprocess.Popen(
        ["bash", "-c", f"exec {command}"], cwd=folder, env=os.environ | {"PATH": path}, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    for line in process.stdout or ():
        printed += line
        if stop is not None and stop in line:
            process.send_signal(signal.SIGINT)
    return printed, process.wait(), time.perf_counter() - begin


def main(folder: Path) -> None:
    write_inputs(folder)
    failed = 0
    for title, commands in TASKS.items():
        print(f"\n## {title}", flush=True)
        printed = ""
        for line in commands:
            proposals = re.findall(r"^ +(holdfast .*)$", printed, re.M)
            command = line.replace(PASTE, proposals[-1] if proposals else PASTE)
            printed, code, seconds = run(command, folder)
            proposed = code == 2 and line is not commands[-1]  # the next command is in the message
            failed += code not in (0, 130) and not proposed
            lines = printed.rstrip().splitlines()
            if len(lines) > 2 * N_SHOWN:
                lines[N_SHOWN:-N_SHOWN] = ["..."]
            text = "\n".join(lines)
            print(f"$ {command}\n{text}\n({seconds:.1f} s, exit {code})", flush=True)
    print(f"\n{failed} commands failed; load of the machine {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    with TemporaryDirectory() as made:
        main(Path(made))
