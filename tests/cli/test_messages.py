"""Bad input: one line that names what was wrong, exit code 2, and no file."""

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

from command_line import Verb
from holdfast.cli import app
from holdfast.contact import Cause
from holdfast.io import save_recording
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow

NO_SERVER = "xela://127.0.0.1:1"
MESSAGES = [
    ("fly", "'fly'", "holdfast --help"),
    ("--fast", "--fast"),
    ("doctor --fast", "--fast", "holdfast doctor --help"),
    ("doctor now then", "extra argument"),
    ("sensors --plot", "--plot", "requires an argument"),
    ("label auto --fast", "--fast", "holdfast label auto --help"),
    ("detect twin:?object=can a.parquet", "builtin:any twin:?object=can"),
    ("detect a.parquet builtin:any", "builtin:any a.parquet"),
    ("detect press.csv builtin:any", "builtin:any press.csv"),
    ("detect builtin:best a.parquet", "builtin:best", "builtin:any"),
    ("detect builtin:any none.parquet", "none.parquet does not exist"),
    ("detect builtin:any data", "data is a folder"),
    ("detect builtin:any empty.mcap", "empty.mcap has no samples"),
    ("detect builtin:any damaged.parquet", "damaged.parquet", "checksum"),
    ("detect builtin:twin wide.parquet", "thumb", "uskin-4x6", "builtin:any"),
    ("detect builtin:twin slow.parquet --rate strict", "75 Hz", "150 Hz", "--rate resample"),
    ("detect builtin:any a.parquet --rate slow", "'slow'", "'strict'"),
    ("detect builtin:any hand", "the source hand was removed"),
    ("detect builtin:any a.parquet --ignore 7", "--ignore", "FINGER:TAXEL", "'7'"),
    ("detect builtin:any a.parquet --ignore index:3,index:31", "index: taxel 31", "1 to 30"),
    ("detect builtin:any a.parquet --debounce=-1", "duration", "-1"),
    ("detect builtin:any a.parquet --seconds 2", "--seconds", "a.parquet"),
    ("detect builtin:any twin: --seconds 0", "--seconds", "0 given"),
    ("detect builtin:any press.csv --sensor skin", "'skin'", "anyskin"),
    ("detect builtin:any press.csv --sensor gtac --sensor gtac", "--sensor", "all modules"),
    ("detect builtin:any none.csv", "none.csv does not exist"),
    ("detect builtin:any a.parquet --sensor gtac", "--sensor", "a.parquet"),
    ("detect builtin:any xela://auto --columns time=t", "--columns", "xela://auto"),
    ("serve builtin:any none.parquet", "none.parquet does not exist"),
    ("serve builtin:any a.parquet --host 0.0.0.0", "--host 0.0.0.0", "--token-file"),
    ("serve builtin:any a.parquet --port 99999", "99999"),
    ("serve builtin:any a.parquet --speed=-1", "--speed", "-1"),
    (f"serve builtin:any {NO_SERVER} --speed 2", "--speed", NO_SERVER),
    ("serve builtin:any a.parquet --token short", "--token", "8 characters", "5 given"),
    ("serve builtin:any a.parquet --token-file none", "--token-file none"),
    ("serve builtin:any a.parquet --token-file data", "--token-file data"),
    ("serve builtin:any a.parquet --token-file damaged.parquet", "--token-file damaged.parquet"),
    ("serve builtin:any a.parquet --token-file none --token 12345678", "--token-file", "only one"),
    ("record twin: a.mcap --seconds 0", "--seconds", "0 given"),
    ("record twin: a.mcap --speed=-1", "--speed", "-1"),
    (f"record {NO_SERVER} a.mcap --speed 2", "--speed", NO_SERVER),
    (f"record {NO_SERVER} a.mcap", "127.0.0.1:1"),
    ("record twin: a.mcap --set a", "--set KEY=VALUE", "'a'"),
    ("record twin: a.mcap --object can --set object=ball", "--set", "object"),
    ("record twin: b.parquet", "b.parquet", "NAME.mcap", "holdfast import"),
    ("record twin: no/a.mcap", "no/a.mcap", "the folder no does not exist"),
    ("record a.parquet kept.mcap", "kept.mcap exists already", "--force"),
    ("record empty.mcap empty.mcap --force", "empty.mcap is the source"),
    ("record a.parquet a.mcap --camera none.mp4", "none.mp4"),
    ("play none.parquet", "none.parquet does not exist"),
    ("play can:3", "'can:3'", "xela:"),
    ("play a.parquet --speed 0", "--speed", "0 given"),
    (f"play {NO_SERVER} --speed 2", "--speed", NO_SERVER),
    ("play finger.parquet --whole-hand", "--whole-hand", "finger1", "allegro-uskin", "thumb"),
    ("import none out", "none does not exist"),
    ("import nothing out", "nothing is empty"),
    ("import nothing out --sensor anyskin", "nothing is empty"),
    ("import other out", "other", "--format", "--sensor"),
    ("import kept out --format bag", "'bag'", "csv"),
    ("import a.parquet out --suffix bag", "'bag'", "'mcap'"),
    ("import a.parquet kept", "kept", "a folder expected"),
    ("import a.parquet kept/deeper", "kept/deeper"),
    ("import press.csv out --columns F", "--columns", "time=COLUMN"),
    ("import a.parquet out --jobs 0", "jobs", "0 given"),
    ("import a.parquet out --engine spark:x", "'spark:x'", "loky", "dask"),
    ("info none", "none does not exist"),
    ("info nothing", "nothing is empty", "holdfast import"),
    ("info other", "no recording in other (1 other", "holdfast import"),
    ("info data --plot x.svg", "--plot", "data"),
    ("info builtin:any --plot x.svg", "--plot", "builtin:any"),
    ("info a.parquet --plot x.txt", "x.txt", ".png"),
    ("info a.parquet --plot kept.svg", "kept.svg exists already", "--force"),
    ("info a.parquet --plot x.svg --tare 90:91", "thumb", "tare 90:91"),
    ("info a.parquet --model builtin:twin", "--model", "--plot FILE"),
    ("label nothing", "nothing", "holdfast import"),
    ("label gone", "gone does not exist"),
    ("label kept", "kept", ".mcap"),
    ("label data --host 0.0.0.0", "--host 0.0.0.0", "--token"),
    ("label data --port 99999", "127.0.0.1:99999"),
    ("label auto magic data", "'magic'", "signal", "tracking"),
    ("label auto signal gone", "gone does not exist"),
    ("label auto signal data --tare soon", "tare", "soon"),
    ("label auto signal data --set share", "--set NAME=VALUE", "'share'"),
    ("label auto signal data --dry-run --set window=1e18", "window", "1e+09", "1e+18"),
    ("label auto signal data --dry-run --set window=9e8", "window", "the recording", "9e+08"),
    ("label auto signal data --poses p.csv", "--poses", "tracking", "'signal'"),
    ("label auto signal data --video a.mp4", "--video", "tracking", "'signal'"),
    ("label auto tracking data --poses gone.csv", "gone.csv"),
    ("label auto tracking data --poses a.bag", "a.bag", "--track object=NAME"),
    ("label auto tracking data --track object=/pose", "--track", "--poses BAG", "--video FILE"),
    ("label data --track object=/pose", "--poses BAG", "label auto tracking` has --video"),
    ("label auto tracking data --video a.mp4 --poses p.csv", "--poses and --video"),
    ("label auto tracking data --video a.mp4 --motion a.csv", "--motion", "--video"),
    ("label auto tracking data --column a", "--column", "--motion FILE.csv"),
    ("label export yaml out data", "csv", "'yaml'"),
    ("label import gone.json data", "gone.json does not exist"),
    ("label import p.csv data", "p.csv", "2 recordings given"),
    ("label markers sheet.png", "sheet.png", ".pdf"),
    ("label markers kept.pdf", "kept.pdf exists already", "--force"),
    ("teach -o new.json", "SOURCE", "--from"),
    ("teach twin: --from data -o new.json", "twin:", "--from data"),
    ("teach --from data -o new.json --resume", "--resume", "SOURCE"),
    ("teach --from a.parquet -o new.json", "0 slips", "holdfast label"),
    ("teach --from gone -o new.json", "gone"),
    ("teach --from data -o kept.json", "kept.json exists already", "--force"),
    ("teach twin: -o new.json --to data --unattended", "data", "teach.json"),
    ("teach twin: -o new.json --resume --unattended", "new-grasps", "nothing to resume"),
    (f"teach {NO_SERVER} -o new.json --camera none.mp4", "none.mp4"),
    (f"teach {NO_SERVER} -o new.json --unattended", "--unattended", "next, repeat, skip"),
    ("train gone -o new.json", "gone"),
    ("train bare -o new.json", "labels"),
    ("train data -o kept.json", "kept.json exists already", "--force"),
    ("train parts -o new.json", "'a' and 'half'", "remove one", "--split object"),
    ("train data -o new.json --classifier magic", "'magic'", "logreg", "svm"),
    ("train data -o new.json --hold=-1", "hold", "-1"),
    ("train data -o new.json --init builtin:twin --window 14", "--init", "leave out --window"),
    ("train data -o new.json --trials 5", "5 trials given", "grid", "holdfast study"),
    ("train data -o new.json --resume", "--resume", "grid", "holdfast study"),
    ("train data -o new.json --for slip --trials 0", "--for slip", "leave the others out"),
    ("evaluate builtin:any gone", "gone"),
    ("evaluate builtin:any bare", "bare", "labels expected"),
    ("evaluate builtin:any data --plot x.txt", "x.txt", ".png"),
    ("evaluate builtin:any data --plot kept.svg", "kept.svg exists already", "--force"),
    ("evaluate builtin:any twins.parquet", "thumb and index", "same readings"),
    ("tune builtin:any data -o new.json --false-alarms=-1", "false alarms", "-1 given"),
    ("tune builtin:any data -o new.json --false-alarms many", "--false-alarms", "number"),
    ("tune builtin:any data -o kept.json --false-alarms 9", "kept.json exists", "--force"),
    ("calibrate builtin:twin data -o new.json", "normalised"),
    ("calibrate builtin:any hand -o new.json", "the source hand was removed"),
    ("calibrate builtin:any data -o new.json --seconds 9", "--seconds", "live sources", "data"),
    ("calibrate builtin:any xela://auto -o new.json --seconds 0", "--seconds", "0 s expected"),
    (
        "calibrate builtin:any slips -o new.json",
        "as slip",
        "at most 1 %",
        "thumb 5.30 to 6.50 s of a",
    ),
    ("calibrate builtin:any data -o kept.json", "kept.json exists already", "--force"),
    ("demo new --speed=-1", "--speed", "-1"),
    ("demo new --seed=-1", "--seed", "-1"),
    ("demo kept/new", "kept/new"),
    ("simulate new --objects cup", "'cup'", "can"),
    ("simulate new --table mug.toml --objects can", "'can'", "mug"),
    ("simulate new --profile rough", "'rough'", "gentle"),
    ("simulate new --cases 3", "--cases", "'3'"),
    ("simulate new --repeats 0", "repeats", "0 given"),
    ("simulate new --seed=-1", "seed", "-1 given"),
    ("simulate new --randomize --grasps 0", "--grasps"),
    ("simulate new --grasps 2", "--randomize"),
    ("simulate new --measured scan", "--randomize"),
    ("simulate new --randomize --measured scan,glue", "'glue'"),
    ("simulate new --faults field=3,rust=1", "--faults", "'rust=1'", "zero-share"),
    ("simulate new --faults drift", "--faults drift", "a number"),
    ("simulate new --faults drift=-1", "drift", "-1"),
    ("simulate new --sensor gtac", "'gtac'", "uskin-curved, orca-finger"),
    ("simulate new --sensor orca-thumb --faults drift=1", "uskin-curved", "orca-thumb"),
    ("simulate kept", "kept"),
    ("export builtin:any model.h --sensor gtac", "--like RECORDING", "--fingers N"),
    ("export builtin:any model.h --like none.parquet", "none.parquet"),
    ("export builtin:any model.c --sensor gtac --fingers 1", ".h"),
    ("export builtin:twin model.h --format csv", "--format", "builtin:twin is a model"),
    ("export data out", "--format", "csv"),
    ("export data kept --format csv", "kept", "a folder"),
    ("export data out --format csv --fingers 2", "--fingers", "data is a recording or a folder"),
    ("export data data --format csv", "data/a.csv exists already", "--force"),
    ("sensors uskin", "'uskin'", "uskin-4x4", "allegro-uskin", ".json"),
    ("sensors finger.urdf", "finger.urdf", "--base LINK"),
    ("sensors gtac --base tip", "--base", "'gtac'"),
    ("sensors gtac --plot x.txt", "x.txt", ".png"),
    ("sensors --plot x.svg", "--plot", "holdfast sensors"),
    ("sensors --template 3", "--template", "3x3", "'3'"),
    ("sensors --template 0x3", "--template", "'0x3'"),
    ("sensors --template 3x3 --pitch 0", "--pitch", "0"),
    ("sensors --template 3x3 --unit kg", "--unit", "'kg'", "N"),
    ("sensors gtac --template 3x3", "--template", "'gtac'"),
    ("doctor --plot x.svg", "--plot", "SOURCE"),
    ("doctor serial:///dev/null?sensor=part.json", "part.json", "'positions'"),
    ("doctor touched.parquet", "index is touched from the start"),
]
"""Words of a command, and what its message must name: what was wrong, or what to type instead."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files that the commands name; `kept` is what a command must not replace."""
    folder = tmp_path_factory.mktemp("messages")
    whole = synthetic_recording("a", 1, ("thumb", "index"))
    thumb = whole.modules["thumb"]
    slips = {
        name: [replace(x, cause=x.cause and Cause.SLIP) for x in module.labels[2:5]]
        for name, module in whole.modules.items()
    }
    half = replace(thumb, times=thumb.times[::2], readings=thumb.readings[::2], labels=())
    wide = Tactile(sensor("uskin-4x6"), np.arange(100) / 100, np.zeros((100, 24, 3)))
    touched = 33_000 + np.rint(np.random.default_rng(0).normal(0, 3, (300, 16, 3)))
    touched[:200, 5, 2] += 500  # one step, louder than any noise
    touched = Tactile(sensor("uskin-4x4"), np.arange(300) / 100, touched)
    for name, modules in {
        "a": whole.modules,
        "data/a": whole.modules,
        "data/b": synthetic_recording("b", 2, ("thumb", "index")).modules,
        "parts/a": whole.modules,
        "parts/half": {"index": thumb.slice(300, 1400)},
        "slips/a": whole.with_labels(slips).modules,
        "bare/a": whole.with_labels({}).modules,
        "slow": {"thumb": half},
        "wide": {"thumb": wide},
        "finger": {"finger1": wide},
        "twins": {"thumb": thumb, "index": thumb},
        "touched": {"index": touched},
    }.items():
        path = folder / f"{name}.parquet"
        path.parent.mkdir(exist_ok=True)
        save_recording(Recording(path.stem, modules), path)
    data = bytearray((folder / "a.parquet").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "damaged.parquet").write_bytes(data)
    RecordingWriter(folder / "empty.mcap", {"thumb": sensor("uskin-curved")}).close()
    (folder / "nothing").mkdir()
    (folder / "other").mkdir()
    for name in ("json", "svg", "pdf", "mcap"):
        (folder / f"kept.{name}").write_text("mine")
    for name in ("kept", "data/a.csv", "other/a.txt"):
        (folder / name).write_text("mine")
    taxels = ",".join(f"F{axis}{taxel}" for taxel in range(9) for axis in "xyz")
    press = "".join(f"{10 * k},{','.join(map(str, range(k, k + 27)))}\n" for k in range(30))
    for name, text in {
        "press.csv": f"timestamp,{taxels}\n{press}",
        "p.csv": "time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0.1,0,0,1,0,0,0\n",
        "part.json": '{"name": "x", "rotations": [], "normal": [0, 0, 1], "rate": 100}',
        "finger.urdf": '<robot name="finger"><link name="tip"/></robot>',
        "mug.toml": 'mug = {shape = "cylinder", size = [0.036, 0.05, 0.003], mass = 0.2, '
        "friction = [0.7, 0.55], texture = [10e-6, 1.5e-3], finger_height = 0.024, yaw = 0.0}",
    }.items():
        (folder / name).write_text(text)
    return folder


def contents(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.mark.parametrize(("words", "named"), [(words, named) for words, *named in MESSAGES])
def test_bad_input_is_one_line(capsys, folder, monkeypatch, words, named):
    monkeypatch.chdir(folder)
    before = contents(folder)
    message = Verb().refusal(capsys, *shlex.split(words))
    assert [text for text in named if text not in message] == []
    for verb in re.findall(r"holdfast ([a-z]+)", message):
        assert verb in app.VERBS
    assert contents(folder) == before
