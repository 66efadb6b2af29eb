"""What holdfast 0.3.0 had and later versions do not have, and what to use instead."""

LAST_COMMIT = "f7d623e5"
"""Commit of version 0.3.0, which still has all of it."""

AUDIT = "holdfast evaluate MODEL RECORDINGS --plot FILE shows where labels and model differ most"
COMPARE = "holdfast label export csv FOLDER RECORDINGS, once for each set of labels"
LABELS_AS_CSV = "labels as CSV, by holdfast label export csv and holdfast label import FILE"
WRITTEN_OUT = (
    "write MODEL, URI and --ignore out, as in holdfast detect builtin:any "
    '"xela://auto?fingers=1:thumb,2:index" --ignore index:7'
)
NONE = "nothing takes its place"

REMOVED: dict[str, dict[str, str]] = {
    "verbs": {
        "label audit": AUDIT,
        "label compare": COMPARE,
        "datasets score": "holdfast evaluate MODEL RECORDINGS",
        "bench": "python benchmarks/speed.py --json",
        "study data": NONE,
        "study score": NONE,
    },
    "options": {
        "label --auto": "holdfast label auto RULE RECORDINGS",
        "label --export": "holdfast label export csv FOLDER RECORDINGS",
        "label --import": "holdfast label import FILE RECORDINGS",
        "label --audit": AUDIT,
        "label --page": AUDIT,
        "label --jobs": AUDIT,
        "label --compare": COMPARE,
        "label --dry-run": "holdfast label auto RULE RECORDINGS --dry-run",
        "label --force": "holdfast label auto RULE RECORDINGS --force",
        "label --set": "holdfast label auto RULE RECORDINGS --set NAME=VALUE",
        "label --video": "holdfast label auto tracking RECORDING --video FILE",
        "label --fps": "holdfast label auto tracking RECORDING --video FILE --fps RATE",
        "label --motion": "holdfast label auto tracking RECORDING --motion FILE",
        "label --column": "holdfast label auto tracking RECORDING --motion FILE --column NAME",
        "label --annotator": LABELS_AS_CSV,
        "label import --annotator": LABELS_AS_CSV,
        "train --objective": "none; the fewest errors of an SVM decide, else the log loss",
        "train --resume": "leave it out: train has a grid now, and holdfast study the search",
        "datasets --yes": "leave it out, no set is larger than 26 MB",
        "--config": WRITTEN_OUT,
        "play --hand": "holdfast hold twin:?object=can --hand twin:",
        **dict.fromkeys(
            (
                "serve --hand",
                "serve --law",
                "serve --armed",
                "serve --confirm",
                "serve --max-scale",
                "serve --min-scale",
                "serve --max-force",
                "serve --on-fault",
                "serve --newtons",
            ),
            "holdfast hold MODEL SOURCE --hand URI in a terminal",
        ),
        **dict.fromkeys(
            ("teach --page", "teach --host", "teach --port", "teach --token", "teach --token-file"),
            "holdfast teach SOURCE -o NAME.json in a terminal",
        ),
        "hold --min-scale": "none; a law never goes below 0.8 of the first force",
        "study --benchmark": NONE,
        "doctor --history": NONE,
        "record --fingers-only": NONE,
        "simulate --film": "holdfast simulate OUT --video films the stickers",
        "record --note": "holdfast record SOURCE OUT --set note=TEXT",
        "detect --raw": NONE,
        "serve --raw": NONE,
        "serve --ros1": "holdfast serve MODEL SOURCE --ros2, and a ros1_bridge beside it",
    },
    "sources": {
        "hand": WRITTEN_OUT,
        "ros1": "rosbag record -O run.bag /xServTopic, then holdfast import run.bag recordings",
    },
    "importers": {
        "anyskin-slip": "holdfast import FILE OUT --sensor anyskin (without labels)",
        "arq-crisp": "holdfast import FILE OUT --array tactile_data_raw=SENSOR (without labels)",
    },
    "labels": {
        "label-studio": LABELS_AS_CSV,
    },
    "exporters": {
        "onnx": "holdfast export MODEL model.h carries a model to other programs",
        "foxglove": "files of holdfast import RECORDINGS OUT --suffix mcap open in Foxglove",
    },
    "hands": {
        "ros1": "ros2:NAME (docs/hands.md), or call:MODULE:FUNCTION with a function on rospy",
    },
    "rules": {
        "onnx": "train a model with holdfast train, or apply a classifier of your own to what "
        "holdfast.features_frame returns",
    },
    "features": dict.fromkeys(
        (
            *(
                f"{mean}second_{what}"
                for mean in ("", "mean_")
                for what in ("all", "shared", "shear", "own", "top")
            ),
            *(f"{what}_gain" for what in ("shear", "normal", "ratio")),
        ),
        "train or teach the model again",
    ),
    "files": {
        "holdfast.toml": WRITTEN_OUT,
    },
    "plugins": {
        "sensors": "a file of the sensor, as holdfast sensors --template 3x3 > sensor.json makes",
        "classifiers": "holdfast.features_frame, which gives the features to any classifier",
        "labels": "CSV, as holdfast label import reads it",
        "panels": NONE,
        "players": NONE,
        "laws": NONE,
        "groups": NONE,
    },
}
"""What to use instead, by kind and name. The kinds are those of `PACKAGE_PARTS` of `errors.py`:
`verbs`, `options`, `sources`, ..., and `labels` (formats of labels), `rules` and `features` (of
heads in model files), `files` and `plugins` (kinds of them). An option has its verb before it:
"serve --hand"."""


def removal(kind: str, name: str, what: str) -> str:
    """Return one line about a part that was removed; empty if no such part was.

    Args:
        kind: of the part, as in `REMOVED`.
        name: of the part.
        what: what the name stands for, as in "the verb hold".
    """
    if (instead := REMOVED.get(kind, {}).get(name)) is None:
        return ""
    return f"{what} was removed after 0.3.0 (commit {LAST_COMMIT} has it): {instead}"
