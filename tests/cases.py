"""Inputs of labs as a table: what each import must give, and what comes out.

    python tests/cases.py                       # the first and the second command of each case
    python tests/cases.py --holdfast PATH       # the same with the command of another installation
    python tests/cases.py 33 37                 # some cases, with all that they print

The inputs are made by the scripts `case_NN.py` in the folder HOLDFAST_CASES, or `shared/cases`
beside the checkout; their docstrings say what must come out.
"""

import argparse
import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

CASES = Path(os.environ.get("HOLDFAST_CASES", Path(__file__).parents[2] / "shared" / "cases"))
"""Folder of the scripts."""
Run = Callable[[Sequence[str], Path], tuple[int, str]]
"""Runs words of a command line in a folder; returns the exit code and all that was printed."""
COMMAND = re.compile(r"^ *(holdfast (?:[^\n\\]|\\\n)*)$", re.MULTILINE)
"""A command in a proposal, perhaps over several lines."""


@dataclass(frozen=True)
class Case:
    """An input and what its import must give.

    Attributes:
        script: number of the script, and its options.
        words: of the command line, after the input and the output.
        first: `imports`, `proposes` (the proposal, when it is pasted, imports) or `refuses`.
        modules: number of taxels by module.
        n: number of samples of each module.
        rate: of the samples [Hz].
        values: readings by module, time [s], taxel from 1, axis, with a tolerance.
        says: texts that must be printed.
    """

    script: str
    words: str = ""
    first: str = "imports"
    modules: Mapping[str, int] = field(default_factory=dict)
    n: int = 0
    rate: float = 0.0
    values: Sequence[tuple[str, float, int, str, float, float]] = ()
    says: Sequence[str] = ()

    @property
    def number(self) -> str:
        """Number of the script."""
        return self.script.split()[0]

    @property
    def id(self) -> str:
        """Name of the case."""
        return f"{self.script} {self.words}".strip()


def skins(*names: str) -> dict[str, int]:
    """Return five taxels for each module."""
    return dict.fromkeys(names, 5)


F1 = skins("finger1")
SKIN = {"words": "--sensor anyskin", "modules": F1, "n": 1000, "rate": 100}
NEWTON = 0.06
"""Tolerance of a force in N with noise of 0.01 N."""

TABLE = (
    Case("02 --comma", "--sensor anyskin", "refuses", says=["time=100Hz", "taxels="]),
    Case("02", "--sensor anyskin --columns time=100Hz,taxels=1..30",
         modules=skins("finger1", "finger2"), n=800, rate=100),
    Case("04", "", "refuses", says=["/dsa_controller/tactile_data"]),
    Case("07", "--sensor 1x31 --unit count", modules={"finger1": 31}, n=400),
    Case("08", "--topic /anyskin_measurements=anyskin", modules=F1, n=800, rate=100),
    Case("08 --no-metadata", "--topic /anyskin_measurements=anyskin", modules=F1, n=800, rate=100),
    Case("09", "--sensor papillarray", modules={"finger1": 9, "finger2": 9}, n=2000, rate=250,
         values=[("finger1", 5.0, 9, "z", 1.3, 0.03), ("finger2", 2.0, 9, "z", 0.0, 0.03)]),
    Case("10", "--array observation.tactile=anyskin", modules=F1, n=240, rate=30),
    Case("10", "--array observation.tactile=anyskin --unit N", modules=F1, n=240, rate=30,
         values=[("finger1", 4.0, 3, "z", 1.0, 0.05)]),
    Case("10 --v21", "--array observation.tactile=anyskin --unit N", modules=F1, n=240, rate=30),
    Case("11", "--sensor anyskin", modules=F1, n=800, rate=100),
    Case("11 --plain", "--sensor anyskin", modules=F1, n=800, rate=100),
    Case("11 --latin", "--sensor anyskin", modules=F1, n=800, rate=100),
    Case("12", "", modules={"finger1": 9}, n=2999, rate=500),
    Case("13", **SKIN),
    Case("14", "--sensor anyskin", modules=F1, n=1500, rate=100),
    Case("15 /slip.npz", "--sensor uskin-4x4", modules={"finger1": 16}, n=800, rate=100),
    Case("15 /slip.mat", "--array tactile=uskin-4x4", modules={"finger1": 16}, n=800, rate=100),
    Case("15 /slip.mat", "--sensor uskin-4x4", "proposes", {"finger1": 16}, 800, 100),
    Case("15 /slip.hdf5", "--sensor uskin-4x4", modules={"finger1": 16}, n=800, rate=100),
    Case("15 /slip.npy", "--array slip=uskin-4x4 --columns time=100Hz", "imports",
         {"finger1": 16}, 800, 100),
    Case("15 /slip.tsv", "--sensor uskin-4x4", modules={"finger1": 16}, n=800, rate=100),
    Case("15 /hash.csv", "--sensor uskin-4x4", modules={"finger1": 16}, n=800, rate=100),
    Case("15 /slip.pkl", "--sensor uskin-4x4", "refuses", says=["numpy.savez"]),
    Case("16", "--sensor uskin-4x4", modules={"finger1": 16}, n=600, rate=100),
    Case("17", "--sensor anyskin", "refuses", says=["three axes"]),
    Case("18 --dup", "--sensor anyskin", "proposes", F1, 1000, 100, says=["time=100Hz"]),
    Case("18 --ntp", "--sensor anyskin", "proposes", F1, 1000, 100, says=["time=100Hz"]),
    Case("19", "", modules={"finger1": 24, "finger2": 24}, n=800, rate=100),
    Case("20", "--array data=anyskin --columns time=100Hz", modules=F1, n=400, rate=100),
    Case("22", "--sensor uskin-4x4", modules={"left": 16, "right": 16}, n=800, rate=100,
         says=["same readings"]),
    Case("24", "", "refuses", says=["mcap recover"]),
    *(Case(f"31 --kind {kind}", "--sensor anyskin", "proposes", F1, 1000, 100)
      for kind in ("const", "zeros", "onezero", "plus500", "none")),
    *(Case(f"32{kind}", "--sensor anyskin", "proposes", F1, 1000, 100,
           [("finger1", 0.1, 1, "z", 7742, 30), ("finger1", 5.0, 1, "z", 7742 + height, 40)],
           ["wrap"]) for kind, height in (("", 640), (" --both", 186))),
    Case("33", "--sensor anyskin", "proposes", F1, 1000, 100,
         [("finger1", 0.0, 2, "x", 0, 30)], ["wrap=65536"]),
    Case("33 --far", "--sensor anyskin", "proposes", F1, 1000, 100,
         [("finger1", 0.5, 1, "z", -200 / 0.15, 40), ("finger1", 5.0, 1, "z", 600 / 0.15, 40)]),
    Case("34", "--topic /tactile_data=anyskin", modules=F1, n=500, rate=50,
         says=["the norm, not z"]),
    Case("35", "--sensor duo.json", "refuses", says=["accelerometer", "normal force alone"]),
    Case("35", "--sensor duo.json --columns time=1000Hz", "refuses", says=["accelerometer"]),
    Case("37", "--array tactile/left/data=duo.json --columns time=30Hz", "proposes",
         {"finger1": 2}, 0, 30, [("finger1", 5.0, 1, "z", 4, NEWTON),
                                 ("finger1", 5.0, 2, "x", 0.3, NEWTON)]),
    Case("38", "--sensor anyskinN.json", "proposes", F1, 1000, 100,
         [("finger1", 5.0, 1, "z", 4.0, NEWTON), ("finger1", 5.0, 1, "x", 0.6, NEWTON)]),
    Case("40", **SKIN, says=["9 lines"]),
    Case("41", "--sensor patch16m.json", modules={"finger1": 16}, n=1000, rate=100),
    Case("41 --clean", "--sensor patch16m.json --columns 'time=t_wall [s]'",
         modules={"finger1": 16}, n=1000, rate=100),
    Case("42", "--array thumb=o51.json --array index=o87.json --array middle=o87.json "
         "--array ring=o87.json --array pinky=o51.json",
         modules={"thumb": 51, "index": 87, "middle": 87, "ring": 87, "pinky": 51}, n=300, rate=30),
    *(Case("43", f"--topic /pad/thumb{path}=pad24.json", modules={"finger1": 24}, n=480, rate=60,
           values=[("finger1", 5.0, 15, "z", 0.53, 0.05)]) for path in ("", ".taxels.force")),
    Case("44", "--topic /tactile=pad120.json", modules={"finger1": 120, "finger2": 120}, n=480,
         rate=60, values=[("finger1", 5.0, 55, "z", 28, 2)]),
    Case("45", "--sensor button.json", modules={"finger1": 1, "finger2": 1}, n=800, rate=100,
         values=[("finger2", 5.0, 1, "z", 4.0, NEWTON)]),
    Case("45", "--sensor papillarray", "proposes", {"finger1": 1, "finger2": 1}, 800, 100,
         [("finger2", 5.0, 1, "z", 4.0, NEWTON)]),
    Case("47", "--sensor anyskin", modules=skins("B0", "B1"), n=1000, rate=100),
    *(Case(f"48{kind}", "--sensor anyskin", modules=skins("B0", "B1"), n=1000, rate=100)
      for kind in ("", " --zeros")),
    *(Case("49", f"--sensor {sensor}", "refuses", says=["direction"])
      for sensor in ("anyskin", "button.json")),
    *(Case(f"50{kind}", **SKIN) for kind in ("", " --csv")),
    Case("51", "--topic /xela=uskin-4x4", modules={"finger1": 16}, n=1000, rate=100,
         says=["10 rows"]),
    Case("51 --slow", "--topic /xela=uskin-4x4", modules={"finger1": 16}, n=100, rate=10),
    Case("52", "--array fingertips/thumb/raw_pressure=pad120.json "
         "--array fingertips/index/raw_pressure=pad120.json",
         modules={"thumb": 120, "index": 120}, n=400, rate=100),
    Case("52", "--sensor pad120.json", modules={"thumb": 120, "index": 120}, n=400, rate=100),
    Case("53", "--sensor anyskin", "proposes", F1, 333, 100 / 3, says=["missing=0"]),
    *(Case("54", words, "refuses", says=["video"])
      for words in ("--array observation.images.tactile_left=anyskin", "")),
    *(Case(script, words, modules={"finger1": 1}, n=240, rate=30,
           values=[("finger1", 5.0, 1, "z", 4.0, NEWTON)])
      for script in ("55", "55 --true-torque")
      for words in ("--topic button.json", "--topic /tip/wrench=button.json",
                    "--topic /tip/wrench.wrench.force=button.json")),
    Case("55 --both", "--topic button.json", modules={"thumb": 1, "index": 1}, n=240, rate=30),
    Case("56", "--sensor uskin-4x4", modules={"finger1": 16, "finger2": 16}, n=1000, rate=100),
    Case("57", **SKIN),
    Case("58", **SKIN, says=["signs"]),
    Case("59", **SKIN),
    Case("61", "--sensor anyskin", modules=F1, n=440, rate=80),
    Case("62", "--array data/tactile=anyskin", "refuses", says=["numpy.savez"]),
)  # fmt: skip


def make(case: Case, folder: Path) -> str:
    """Make the input of a case in a folder, with its sensor files; return its name."""
    number, *options = case.script.split()
    inside = options.pop() if options and options[-1].startswith("/") else ""
    script = CASES / f"case_{number}.py"
    default = re.search(r'else "([^"]+)"\)?', script.read_text())
    name = default[1] if default else "input"
    name = name.replace(".json", ".csv") if "--csv" in options else name
    subprocess.run([sys.executable, script, name, *options], cwd=folder, check=True)
    for path in re.findall(r"[\w.]+\.json", case.words):
        (folder / path).write_text((CASES / "sensors" / path).read_text())
    return name + inside


def outcome(case: Case, folder: Path, run: Run) -> tuple[list[str], list[str]]:
    """Run the first command of a case, and the second if it proposes one.

    Returns:
        What was printed by each, and what is wrong.
    """
    source = make(case, folder)
    code, first = run(["holdfast", "import", source, "out", *shlex.split(case.words)], folder)
    printed, wrong = [first], []
    command = COMMAND.search(first) if code else None
    kind = "imports" if code == 0 else "proposes" if command else "refuses"
    if code not in (0, 2):
        wrong.append(f"exit code {code}")
    if kind != case.first:
        wrong.append(f"{kind} in place of {case.first}")
    if command:
        code, second = run(shlex.split(command[1].replace("\\\n", "")), folder)
        printed.append(second)
        if code:
            wrong.append("the proposal does not import")
    wrong += [f"does not say {text!r}" for text in case.says if text not in "".join(printed)]
    return printed, wrong + (differences(case, folder / "out") if code == 0 else [])


def differences(case: Case, out: Path) -> list[str]:
    """Return how the first recording in a folder differs from what a case must give."""
    from holdfast.io import load_dataset

    recording = next(iter(load_dataset(out)))
    modules = recording.modules
    wrong = []
    if (got := {name: one.sensor.n_taxels for name, one in modules.items()}) != case.modules:
        return [f"modules {got}"]
    for name, module in modules.items():
        if case.n and module.n_samples != case.n:
            wrong.append(f"{name}: {module.n_samples} samples")
        if case.rate and abs(module.rate / case.rate - 1) > 0.02:
            wrong.append(f"{name}: {module.rate:.4g} Hz")
    for name, time, taxel, axis, value, tolerance in case.values:
        module = modules[name]
        index = int(np.argmin(np.abs(module.times - case_start(modules) - time)))
        reading = float(module.readings[index, taxel - 1, "xyz".index(axis)])
        if not abs(reading - value) <= tolerance:
            wrong.append(f"{name} taxel {taxel} {axis} at {time} s: {reading:.5g}, not {value:.5g}")
    return wrong


def case_start(modules: Mapping[str, object]) -> float:
    """Return the time at which a recording begins; 0 if its clock does."""
    start = min(float(one.times[0]) for one in modules.values())
    return 0.0 if start < 5 else start


def run_here(words: Sequence[str], folder: Path) -> tuple[int, str]:
    """Run words of a command line in this process."""
    from holdfast.cli import main as command

    printed = io.StringIO()
    before = Path.cwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            code = command(list(words[1:]))
    finally:
        os.chdir(before)
    return code, printed.getvalue()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("numbers", nargs="*", help="only these cases, with all that they print")
    parser.add_argument("--holdfast", help="a command to run in place of this package")
    options = parser.parse_args()

    def run(words: Sequence[str], folder: Path) -> tuple[int, str]:
        if options.holdfast is None:
            return run_here(words, folder)
        done = subprocess.run(
            [options.holdfast, *words[1:]], cwd=folder, text=True, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        return done.returncode, done.stdout

    cases = [case for case in TABLE if not options.numbers or case.number in options.numbers]
    n_wrong = 0
    for case in cases:
        with tempfile.TemporaryDirectory() as name:
            printed, wrong = outcome(case, Path(name), run)
        n_wrong += bool(wrong)
        print(f"{'WRONG' if wrong else 'right'}  {case.id}", *wrong, sep="  |  ", flush=True)  # noqa: T201
        if options.numbers:
            print("\n".join(printed))  # noqa: T201
    print(f"{len(cases) - n_wrong} of {len(cases)} cases are right")  # noqa: T201


if __name__ == "__main__":
    main()
