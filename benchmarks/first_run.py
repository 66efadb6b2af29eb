"""Time until `holdfast demo` shows its first result after a fresh install.

    python benchmarks/first_run.py

A new environment gets this project and the extras of the demo by uv, without byte code.
The time begins with the command; the installation does not count.
"""

import json
import os
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

PROJECT = Path(__file__).parents[1]
EXTRAS = "twin,train,parquet"
FIRST_RESULT = "STABLE"
"""The first state of a finger that the demo prints."""
TIMEOUT = 120.0
"""Maximum time to wait for the demo [s]."""


def first_run(folder: Path) -> dict[str, float]:
    """Return the times of the first line and of the first result [s]."""
    environment = folder / "environment"
    subprocess.run(["uv", "venv", "--quiet", environment], check=True)
    install = ["uv", "pip", "install", "--quiet", "--python", str(environment / "bin" / "python")]
    subprocess.run([*install, f"{PROJECT}[{EXTRAS}]"], check=True)
    command = str(environment / "bin" / "holdfast")
    words = [command, "demo", str(folder / "demo"), "--no-browser"]
    variables = os.environ | {"PYTHONUNBUFFERED": "1"}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    begin = time.perf_counter()
    demo = subprocess.Popen(
        words, env=variables, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    times: dict[str, float] = {}
    try:
        for line in demo.stdout or ():
            elapsed = round(time.perf_counter() - begin, 2)
            times.setdefault("first line [s]", elapsed)
            if FIRST_RESULT in line:
                return {**times, "first result [s]": elapsed}
            if elapsed > TIMEOUT:
                break
    finally:
        demo.terminate()
        demo.wait()
    raise SystemExit(f"no {FIRST_RESULT} within {TIMEOUT:g} s")


if __name__ == "__main__":
    with TemporaryDirectory() as made:
        load = os.getloadavg()[0]
        report = {**first_run(Path(made)), "load of the machine": round(load, 1)}
    print(json.dumps(report, indent=1))
