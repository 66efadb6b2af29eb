"""Time what a new user waits for, in a fresh clone and environment.

    python benchmarks/first_run.py [--teach]

The clone has no byte code and nothing is built; packages come from the cache of uv, as far as it
has them. Each time begins with the first command that it needs: `git clone` for the demo, and the
command itself afterwards. The table has the bar of each, and the load of the machine: on one that
is busy no time means much.
"""

import argparse
import os
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

PROJECT = Path(__file__).parents[1]
FIRST_STATE = "STABLE"
"""The first state of a finger that the demo prints."""
MAX_SECONDS = 1800.0
"""Maximum time to wait for a command [s]."""
WRITE_CSV = """
import numpy as np
from holdfast.synthetic import synthetic_recording
module = synthetic_recording("press", 0, ("thumb",)).modules["thumb"]
rows = np.hstack([module.times[:, None], module.readings.reshape(module.n_samples, -1)])
names = [f"{axis}{k}" for k in range(rows.shape[1] // 3) for axis in "xyz"]
header = ",".join(["time", *names])
np.savetxt("press.csv", rows, delimiter=",", header=header, comments="")
"""


def timed(command: list[str], folder: Path, text: str = "") -> tuple[float, float]:
    """Run a command; return the times until a text is printed, and until it ends [s].

    Raises:
        SystemExit: the command fails, takes too long, or never prints the text.
    """
    variables = os.environ | {"PYTHONUNBUFFERED": "1"}
    for name in ("PYTHONDONTWRITEBYTECODE", "VIRTUAL_ENV", "UV_NO_SYNC"):
        variables.pop(name, None)
    begin, found, printed = time.perf_counter(), 0.0, ""
    process = subprocess.Popen(
        command, cwd=folder, env=variables, text=True, errors="replace",
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        for line in process.stdout or ():
            printed += line
            elapsed = time.perf_counter() - begin
            if text in line and not found:
                found = elapsed
            if elapsed > MAX_SECONDS:
                break
        status = process.wait(timeout=60)
    finally:
        process.kill()
    if status or not found:
        raise SystemExit(f"{' '.join(command)}: status {status}, {text!r} expected\n{printed}")
    return found, time.perf_counter() - begin


def main(folder: Path, *, teach: bool) -> None:
    load = os.getloadavg()[0]
    clone = folder / "holdfast"
    _, cloned = timed(["git", "clone", "--progress", str(PROJECT), str(clone)], folder)
    first, end = timed(["uv", "run", "holdfast", "demo", "--no-browser"], clone, FIRST_STATE)
    print("| | seconds | bar |\n|---|--:|--:|")
    print(f"| `git clone` to the first state of the demo | {cloned + first:.0f} | 60 |")
    print(f"| `git clone` to the end of the demo | {cloned + end:.0f} | |")
    holdfast = str(clone / ".venv" / "bin" / "holdfast")
    _, again = timed([holdfast, "demo", "--no-browser", "--force"], clone, FIRST_STATE)
    print(f"| the demo, once it is installed | {again:.0f} | 40 |")
    python = str(clone / ".venv" / "bin" / "python")
    subprocess.run([python, "-c", WRITE_CSV], cwd=folder, check=True)
    words = [holdfast, "detect", "builtin:any", "press.csv", "--sensor", "uskin-curved"]
    _, states = timed([*words, "--summary"], folder, FIRST_STATE)
    print(f"| own CSV file to states | {states:.0f} | 120 |", flush=True)
    if teach:
        words = [holdfast, "teach", "twin:", "-o", "taught.json", "--unattended"]
        _, taught = timed(words, folder, "taught.json")
        print(f"| a taught model of the twin | {taught:.0f} | 900 |")
    size = sum(path.stat().st_size for path in (clone / ".venv").rglob("*") if path.is_file())
    print(f"\nThe environment has {size / 1e6:.0f} MB; load of the machine at the start {load:.1f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--teach", action="store_true", help="time `teach` too: some minutes")
    with TemporaryDirectory() as made:
        main(Path(made), teach=parser.parse_args().teach)
