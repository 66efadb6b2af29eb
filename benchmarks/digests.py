"""Digests of what holdfast prints, writes and sends: a clean-up must not change them.

    python benchmarks/digests.py write benchmarks/digests.json     # before the change
    python benchmarks/digests.py check benchmarks/digests.json     # after it: lists what differs
    python benchmarks/digests.py check benchmarks/digests.json --parts grip,sockets

All of it goes through the command line and through sockets, so that the program needs no name of a
module. Times of the clock, paths and versions are left out. Recordings and models depend on the
last bits of the machine's mathematics: compare runs of one machine.
"""

import argparse
import contextlib
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

from websockets.sync.client import connect

HOLDFAST = Path(sys.executable).with_name("holdfast")
DATA = Path(os.environ.get("HOLDFAST_DATA", Path(__file__).parents[2] / "shared" / "data"))
MODELS = ("builtin:any", "builtin:twin", "builtin:noise-floor")
LAWS = ("holdfast", "pr2", "wong-zhu", "friction-margin", "fixed")
CLOCK_FIELDS = {
    "time", "started", "received", "cost", "seconds", "versions", "created", "machine", "latency",
    "data", "elapsed", "python", "date", "out", "model",
}  # fmt: skip
N_PACKETS, N_ESTIMATES = 300, 400
DIGEST_LENGTH = 12
SIMULATIONS = {
    "main": "--objects can,ball,box --repeats 1 --seed 3",
    "gentle": "--objects can --profile gentle --repeats 1",
    "hands": "--randomize --repeats 2 --grasps 2 --seed 5",
    "server": "--objects can --cases 2 --server --repeats 1",
}
TRAININGS = {
    "logreg": "main --trials 0",
    "searched": "main",
    "svm": "main --classifier svm --trials 0",
    "holdfast": "main --features holdfast --trials 0",
    "any": "hands --features any --trials 0",
    "adapted": "main --init builtin:any",
}
REAL_SETS = ("uskin_pick_move", "gtac", "gtac_v2", "eflesh_slip")
DETECT_EVERY = 5
"""One of so many real recordings is a case of `detect`."""
CONTENT = """
import sys
from holdfast import load_recording
recording = load_recording(sys.argv[1])
for name, module in recording.modules.items():
    print(name, module.sensor.name, module.times.tobytes(), module.readings.tobytes())
print(recording.markers)
"""
UNLABELLED = """
from pathlib import Path
from holdfast import load_dataset, save_recording
Path('handling').mkdir(exist_ok=True)
for recording in load_dataset('main'):
    save_recording(recording.with_labels({}), f'handling/{recording.name}.parquet', force=True)
"""
LIVE = """
import sys, msgspec
from holdfast import Model, StreamDetector, load_recording, open_source, save_recording
recording = load_recording(sys.argv[1])
save_recording(recording, 'copy.mcap')
copy = load_recording('copy.mcap')
print(len(copy.modules), copy.digest)
with open_source(sys.argv[1]) as source:
    for estimate in StreamDetector(Model.load('builtin:any'), source):
        print(msgspec.json.encode(estimate, enc_hook=dict).decode())
"""


def recordings(folder):
    for name, options in SIMULATIONS.items():
        holdfast("simulate", name, *options.split(), "--jobs", 2, cwd=folder)
        yield f"simulate/{name}", files(folder / name)
        yield f"info/{name}", document(holdfast("info", name, "--json", cwd=folder))
    for name in REAL_SETS:
        if (DATA / name).is_dir():
            holdfast("import", DATA / name, f"real-{name}", cwd=folder)
            yield f"import/{name}", files(folder / f"real-{name}")


def decisions(folder):
    paths = sorted((folder / "main").glob("*.parquet"))[:2]
    for model in MODELS:
        for path in paths:
            name = path.relative_to(folder)
            lines = holdfast("detect", model, name, "--json", cwd=folder, check=False)
            yield f"detect/{model}/{name}", digest(lines)
        yield (
            f"evaluate/{model}",
            document(holdfast("evaluate", model, "main", "--json", cwd=folder)),
        )
    yield "live", digest(python(LIVE, first(folder), cwd=folder))
    yield "mcap", digest((folder / "copy.mcap").read_bytes())
    yield "sensors", digest(holdfast("sensors", "--json", cwd=folder))


def models(folder):
    for name, options in TRAININGS.items():
        holdfast("train", *options.split(), "-o", f"{name}.json", "--force", cwd=folder)
        yield f"train/{name}", document((folder / f"{name}.json").read_text())
    options = ("-o", "tuned.json", "--false-alarms", 2, "--force")
    holdfast("tune", "builtin:any", "main", *options, cwd=folder)
    yield "tune", document((folder / "tuned.json").read_text())


def hands(folder):
    """Models of one's own hand, the C header, and a recording of a source."""
    python(UNLABELLED, cwd=folder)  # by its labels, it has too much slip for own handling
    holdfast("calibrate", "builtin:any", "handling", "-o", "mine.json", "--force", cwd=folder)
    yield "calibrate", document((folder / "mine.json").read_text())
    words = ("teach", "--from", "main", "-o", "taught.json", "--force", "--json")
    taught = json.loads(holdfast(*words, cwd=folder))
    yield "teach", document(json.dumps(taught))
    yield "teach/model", document((folder / "taught.json").read_text())
    for model in ("builtin:twin", "builtin:any", "mine.json", "taught.json"):
        holdfast("export", model, "model.h", "--like", first(folder), "--force", cwd=folder)
        yield f"header/{model}", digest((folder / "model.h").read_bytes())
    holdfast("record", first(folder), "again.mcap", "--speed", 0, "--force", cwd=folder)
    yield "record", digest(python(CONTENT, "again.mcap", cwd=folder))


def real(folder):
    """README's commands on the real recordings; a refusal is an answer too."""
    for name in REAL_SETS:
        recordings = f"real-{name}"
        if not (folder / recordings).is_dir():
            continue
        yield f"info/{name}", digest(holdfast("info", recordings, "--json", cwd=folder))
        mine = f"{name}.json"
        words = ("calibrate", "builtin:any", recordings, "-o", mine, "--force", "--json")
        yield f"calibrate/{name}", digest(refusal_or_output(*words, cwd=folder))
        for model in ("builtin:any", *([mine] if (folder / mine).exists() else ())):
            words = ("evaluate", model, recordings, "--json")
            yield f"evaluate/{model}/{name}", digest(refusal_or_output(*words, cwd=folder))
            for path in sorted((folder / recordings).iterdir())[::DETECT_EVERY]:
                words = ("detect", model, path.relative_to(folder), "--json")
                yield (
                    f"detect/{model}/{path.relative_to(folder)}",
                    digest(refusal_or_output(*words, cwd=folder)),
                )


def grip(folder):
    options = ("--speed", 0, "--newtons", 0.01, "--json")
    for law in LAWS:
        hand = ("--hand", "log:commands.txt", "--law", law)
        commands = holdfast("hold", "builtin:twin", first(folder), *hand, *options, cwd=folder)
        yield f"hold/{law}", digest(commands)


def sockets(folder):
    with server("play", first(folder), "--port", 0, "--once", cwd=folder) as address:
        with connect(address.replace("xela://", "ws://")) as socket:
            packets = [json.loads(socket.recv(10)) for _ in range(N_PACKETS)]
        yield "play", digest(json.dumps(sorted({key for x in packets for key in x})))
    with server(
        "serve", "builtin:any", first(folder), "--port", 0, "--once", cwd=folder
    ) as address:
        for name in ("schema", "info"):
            with urllib.request.urlopen(f"{address}/api/v1/{name}") as reply:
                yield f"serve/{name}", document(reply.read())
        with connect(f"{address.replace('http', 'ws')}/api/v1/estimates") as socket:
            socket.recv(10)
            seen = [json.loads(socket.recv(10)) for _ in range(N_ESTIMATES)]
        yield "serve/estimates", digest(json.dumps(sorted({key for x in seen for key in x})))


def studies(folder):
    options = ("--n", 6, "--laws", "fixed,pr2,holdfast")
    holdfast("trial", "--out", "trials", *options, "--force", cwd=folder)
    yield "trial", document((folder / "trials" / "trial.json").read_text())
    holdfast("study", "--twin", "--quick", "--out", "study", "--force", cwd=folder)
    tables = json.loads((folder / "study" / "study.json").read_text())["tables"]
    del tables["cost"]  # measured times
    for name, rows in tables.items():
        yield f"study/{name}", digest(json.dumps(without_clock(rows), sort_keys=True))


PARTS = {
    part.__name__: part
    for part in (recordings, decisions, models, hands, real, grip, sockets, studies)
}
"""All parts, in the order in which each needs the files of those before it."""


def holdfast(*words, cwd, check=True):
    done = subprocess.run(
        [HOLDFAST, *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False
    )
    if check and done.returncode:
        raise SystemExit(f"{words}: exit {done.returncode}: {done.stderr}")
    return done.stdout


def refusal_or_output(*words, cwd):
    """Return the exit code, and what a verb prints on stdout."""
    done = subprocess.run([HOLDFAST, *map(str, words)], cwd=cwd, capture_output=True, check=False)
    return f"{done.returncode} ".encode() + done.stdout


def python(program, *words, cwd):
    """Return what a program prints."""
    command = [sys.executable, "-c", program, *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, check=True).stdout


@contextlib.contextmanager
def server(*words, cwd):
    process = subprocess.Popen(
        [HOLDFAST, *map(str, words), "--json"], cwd=cwd, stdout=subprocess.PIPE, text=True,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        answer = json.loads(process.stdout.readline())
        address = next(value for value in map(str, answer.values()) if "://" in value)
        yield address.split("?")[0].rstrip("/")
    finally:
        process.terminate()
        process.wait()


def first(folder):
    return min((folder / "main").glob("*.parquet")).relative_to(folder)


def digest(data):
    return hashlib.sha256(data if isinstance(data, bytes) else data.encode()).hexdigest()


def document(text):
    return digest(json.dumps(without_clock(json.loads(text)), sort_keys=True))


def files(folder):
    lines = (
        f"{path.name} {digest(path.read_bytes())}\n" for path in sorted(folder.glob("*.parquet"))
    )
    return digest("".join(lines))


def without_clock(value):
    """Return a document without the values that depend on the clock or the machine."""
    if isinstance(value, dict):
        return {k: without_clock(v) for k, v in value.items() if k not in CLOCK_FIELDS}
    if isinstance(value, list):
        return [without_clock(v) for v in value]
    return value


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("action", choices=["write", "check"])
    parser.add_argument("path", type=Path, help="JSON file of the digests by name.")
    parser.add_argument("--parts", default=",".join(PARTS), help="Some of: %(default)s.")
    parser.add_argument("--folder", type=Path, help="Folder in which the files are kept.")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.folder or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        made = {}
        for part in options.parts.split(","):
            for name, value in PARTS[part](folder):
                made[name] = value[:DIGEST_LENGTH]
                print(name, made[name], file=sys.stderr, flush=True)
    kept = json.loads(options.path.read_text()) if options.path.exists() else {}
    if options.action == "write":
        options.path.write_text(json.dumps(kept | made, indent=1, sort_keys=True) + "\n")
        return 0
    differ = sorted(name for name in made if kept.get(name) != made[name])
    print(f"{len(made) - len(differ)} of {len(made)} digests are equal")
    print("".join(f"differs: {name}\n" for name in differ), end="")
    return int(bool(differ))


if __name__ == "__main__":
    sys.exit(main())
