"""Attack holdfast, and count what comes of it.

    uv run python benchmarks/attack.py network               # more than a million packets
    uv run python benchmarks/attack.py network --scale 0.01 --json
    uv run python benchmarks/attack.py files                 # more than 200,000 files, 200 kills
    uv run python benchmarks/attack.py grip                  # clocks, bursts, paused processes

The exit code is 1 if an attack gave a wrong value, an exception that is not documented, or took
longer than it may. All traffic stays on this machine.
"""

import argparse
import importlib
import json
import sys

PARTS = ("network", "files", "grip")


def main() -> int:
    """Run the attacks of a part, and print their counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    failed = 0
    for result in importlib.import_module(f"attack.{options.part}").attacks(options.scale):
        failed += result.failed
        print(json.dumps(result.document()) if options.json else _row(result), flush=True)
    return min(failed, 1)


def _row(result) -> str:
    counts = (result.n_tried, result.n_accepted, result.n_refused)
    bad = (result.n_wrong, result.n_foreign, result.n_slow)
    figures = " | ".join(f"{count:,}" for count in (*counts, *bad))
    return f"| {result.attack} | {figures} | {result.worst:.3g} | {result.note} |"


if __name__ == "__main__":
    sys.exit(main())
