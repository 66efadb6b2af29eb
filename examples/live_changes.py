"""Print the changes of contact state of a source: live_changes.py [SOURCE] [MODEL].

Without a source, a synthetic recording is replayed. For a hand: live_changes.py xela://auto
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from holdfast import Model, StreamDetector, open_source, save_recording
from holdfast.synthetic import synthetic_recording


def print_changes(source: str, model: str, speed: float = 1.0) -> None:
    """Print one line for each change that lasted, until the source ends or Ctrl-C."""
    with open_source(source, speed=speed) as opened:
        detector = StreamDetector(Model.load(model), opened)
        for change in detector.changes():
            time = change.time - detector.start  # the clock of a device counts from 1970
            print(f"{time:7.2f} s  {change.finger:8} {change.previous} -> {change.state}")


def main(source: str = "", model: str = "builtin:twin") -> None:
    """Replay a synthetic recording if there is no source."""
    if source:
        print_changes(source, model)
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "grasp.parquet"
        save_recording(synthetic_recording("grasp", seed=1), path)
        print_changes(str(path), model, speed=0)


if __name__ == "__main__":
    main(*sys.argv[1:])
