"""The exported header gives what `Detector` gives, and is generated from the kernel."""

import ast
import copy
import ctypes
import math
import platform
import re
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pytest

from exporters.c_detector import (
    STATES,
    WARNINGS,
    CDetector,
    both,
    compare,
    random_samples,
)
from exporters.models import HAND, MODELS, TIP, built_in, made, paper, rich
from holdfast.compiled import sums_in_any_order
from holdfast.contact import ContactState, Fault
from holdfast.detector import Detector
from holdfast.errors import ModelError
from holdfast.exporters import c_functions, header_of
from holdfast.exporters.c_functions import Program, Statements
from holdfast.exporters.c_values import CNumber
from holdfast.io.importers import import_recordings
from holdfast.synthetic import synthetic_recording
from holdfast.training import calibrate

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler is installed"),
]

DRIVE = Path(__file__).with_name("drive.c")
COMPILERS = {
    "gcc": ("gcc", "-std=c99"),
    "clang": ("clang", "-std=c99"),
    "g++": ("g++", "-x", "c++", "-std=c++17"),
    "clang++": ("clang++", "-x", "c++", "-std=c++17"),
    "sanitized": ("gcc", "-std=c99", "-g", "-fsanitize=address,undefined",
                  "-fno-sanitize-recover=all"),
}  # fmt: skip


def compiled(compiler, folder, header, *options):
    """Return the path of `drive.c`, compiled with a header without any warning."""
    command = COMPILERS[compiler]
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    (folder / "model.h").write_text(header.text)
    program = folder / "drive"
    words = [*command, *WARNINGS, "-O2", "-ffp-contract=off", *options, f"-I{folder}", DRIVE]
    done = subprocess.run(
        [*words, "-o", program, "-lm"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and done.stderr == ""
    return program


def driven(program, samples, names, n_taxels, dtype=np.float64):
    """Return the rows that `drive.c` prints for samples and times."""
    data = b""
    for sample, time in samples:
        readings = np.concatenate([sample.get(n, np.full((k, 3), np.nan)) for n, k in
                                   zip(names, n_taxels, strict=True)])  # fmt: skip
        data += np.float64(time).tobytes() + readings.astype(dtype).tobytes()
    done = subprocess.run([program], input=data, capture_output=True, check=True)
    return [line.split() for line in done.stdout.decode().splitlines()]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ["paper", "twin", "any-newton", "rich"])
def test_every_compiler_accepts_it_and_gives_the_same(name, compiler, tmp_path):
    model, sensors, rate = made(name)
    program = compiled(compiler, tmp_path, header_of(model, sensors, rate))
    counts = next(iter(sensors.values())).unit == "count"
    samples = list(random_samples(np.random.default_rng(5), sensors, rate, 600, counts))
    rows = driven(program, samples, list(sensors), [s.n_taxels for s in sensors.values()])
    detector, last = Detector(model, sensors, rate), -np.inf
    for (sample, time), row in zip(samples, rows, strict=True):
        assert int(row[0]) == (0 if last < time < np.inf else -1)
        if int(row[0]) == 0:
            last = time
            hand = detector.update(sample, time)
        assert STATES[int(row[2])] is hand.state
        for finger, state, probability in zip(hand.fingers.values(), row[3::2], row[4::2],
                                              strict=True):  # fmt: skip
            assert STATES[int(state)] is finger.state
            assert float(probability) == pytest.approx(finger.stable_probability, abs=1e-9,
                                                       nan_ok=True)  # fmt: skip


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("name", MODELS)
def test_single_precision_compiles(name, compiler, tmp_path):
    model, sensors, rate = made(name)
    compiled(compiler, tmp_path, header_of(model, sensors, rate, single=True))


@pytest.mark.parametrize("name", MODELS)
def test_random_samples_give_the_same(name, tmp_path):
    model, sensors, rate = made(name)
    counts = next(iter(sensors.values())).unit == "count"
    python, c = both(model, sensors, rate, tmp_path)
    seen = Counter()
    for samples, time in random_samples(np.random.default_rng(2), sensors, rate, 2500, counts):
        hand = compare(python, c, samples, time)
        if hand is not None:
            seen.update(x.state for x in hand.fingers.values())
            seen.update(fault for x in hand.fingers.values() for fault in x.faults)
    assert {ContactState.UNKNOWN, ContactState.UNSTABLE, Fault.REPEATED} <= set(seen)
    assert len(seen) > 5 and (Fault.OFFSET in seen) == counts


@pytest.mark.parametrize("name", ["paper", "twin", "any"])
@pytest.mark.parametrize("in_contact", [False, True])
def test_a_grasp_gives_the_same(name, in_contact, tmp_path):
    model, sensors, rate = made(name)
    recording = synthetic_recording("made", 3, tuple(sensors))
    python, c = both(model, sensors, rate, tmp_path, in_contact=in_contact)
    seen = run_recording(python, c, recording)
    assert seen > {ContactState.UNKNOWN}


def run_recording(python, c, recording):
    """Compare both detectors over a recording. Return the states of the fingers."""
    times = np.unique(np.concatenate([m.times for m in recording.modules.values()]))
    rows = {name: dict(zip(m.times, m.readings, strict=True))
            for name, m in recording.modules.items()}  # fmt: skip
    seen = set()
    for time in times.tolist():
        samples = {name: known[time] for name, known in rows.items() if time in known}
        hand = compare(python, c, samples, time)
        seen |= {finger.state for finger in hand.fingers.values()}
    return seen


def test_a_calibrated_model_gives_the_same(tmp_path):
    recordings = [synthetic_recording(f"made-{k}", k, tuple(HAND)) for k in range(2)]
    model = calibrate(built_in("any"), recordings)
    model = getattr(model, "model", model)
    python, c = both(model, HAND, 150.0, tmp_path)
    run_recording(python, c, recordings[0])


@pytest.mark.parametrize("tare", ["0.5", "first", "none"])
def test_every_tare_gives_the_same(tare, tmp_path):
    model = paper(tare=tare)
    python, c = both(model, HAND, 150.0, tmp_path)
    for samples, time in random_samples(np.random.default_rng(4), HAND, 150.0, 700):
        compare(python, c, samples, time)


def test_a_long_stream_of_large_times_gives_the_same(tmp_path):
    model, sensors, rate = made("any-newton")
    python, c = both(model, sensors, rate, tmp_path)
    for k, (samples, _) in enumerate(
        random_samples(np.random.default_rng(6), sensors, rate, 4000, counts=False)
    ):
        compare(python, c, samples, 1.7e9 + k / rate)


@pytest.mark.parametrize("format_", ["uskin_pick_move", "gtac", "gtac_v2"])
def test_real_recordings_give_the_same(format_, data_folder, tmp_path):
    folder = data_folder / format_
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    recording = next(iter(import_recordings(folder)))
    recording = recording.recording if hasattr(recording, "recording") else recording
    model = built_in("any")
    sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
    python, c = both(model, sensors, recording.rate, tmp_path)
    modules = {name: m.slice(0, 2500) for name, m in
               recording.modules.items() if name in sensors}  # fmt: skip
    run_recording(python, c, type(recording)(recording.name, modules))


def test_single_precision_is_within_its_tolerance(tmp_path):
    recording = synthetic_recording("made", 3, tuple(HAND))
    python, c = both(built_in("twin"), HAND, 150.0, tmp_path, single=True)
    n_other = 0
    for k, time in enumerate(recording.modules["index"].times.tolist()):
        samples = {name: m.readings[k] for name, m in recording.modules.items()}
        hand = python.update(samples, 1.7e9 + time)
        _, got = c.update(samples, 1.7e9 + time)
        for expected, finger in zip(hand.fingers.values(), got.finger, strict=True):
            n_other += STATES[finger.state] is not expected.state
            if STATES[finger.state] is expected.state:
                assert finger.stable_probability == pytest.approx(
                    expected.stable_probability, abs=2e-3, nan_ok=True
                )
    assert n_other <= 0.001 * 3 * 1725


def test_nothing_allocates_and_nothing_is_kept(tmp_path):
    (tmp_path / "model.h").write_text(header_of(rich(), *made("rich")[1:]).text)
    library = tmp_path / "model.o"
    command = ["cc", "-std=c99", "-O2", "-DHOLDFAST_API=extern", "-x", "c", "-c"]
    subprocess.run([*command, tmp_path / "model.h", "-o", library], check=True)
    listed = subprocess.run(["nm", library], check=True, capture_output=True, text=True).stdout
    symbols = [line.split()[-2:] for line in listed.splitlines()]
    outside = {name for kind, name in symbols if kind == "U"}
    maths = {"exp", "expm1", "log", "tanh", "sqrt", "nextafter", "fabs", "copysign"}
    assert outside <= maths | {"memset", "memcpy", "memmove", "_GLOBAL_OFFSET_TABLE_"}
    assert not [name for kind, name in symbols if kind in "BbDdC"]  # data that can change


def test_a_detector_without_header_or_of_another_is_refused(tmp_path):
    _, c = both(paper(), HAND, 150.0, tmp_path)
    samples = {"thumb": np.zeros((30, 3))}
    c.memory.raw = bytes(len(c.memory.raw))
    code, estimate = c.update(samples, 0.0)
    assert code == -2 and STATES[estimate.state] is ContactState.UNKNOWN


def test_two_headers_in_one_program_are_an_error(tmp_path):
    (tmp_path / "one.h").write_text(header_of(paper(), HAND, 150.0).text)
    (tmp_path / "two.h").write_text(header_of(built_in("any"), HAND, 150.0).text)
    for text, expected in (
        ('#include "one.h"\n#include "one.h"\n', ""),
        ('#include "one.h"\n#include "two.h"\n', "another model or version"),
        ('#define HOLDFAST_EXPECTED_ID 1u\n#include "one.h"\n', "not the one"),
    ):
        (tmp_path / "main.c").write_text(text + "int main(void) { return 0; }\n")
        words = ["cc", "-std=c99", "-fsyntax-only", tmp_path / "main.c"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert (expected in done.stderr) and (done.returncode == 0) == (expected == "")


def test_an_update_may_receive_constant_and_other_arrays(tmp_path):
    (tmp_path / "model.h").write_text(header_of(paper(), {"a": TIP}, 150.0).text)
    (tmp_path / "main.c").write_text(
        '#include "model.h"\nint main(void) {\n'
        "static holdfast_detector d; static double open[HOLDFAST_N_TAXELS][3];\n"
        "static const double fixed[HOLDFAST_N_TAXELS][3] = {{0}};\n"
        "holdfast_estimate e; holdfast_init(&d);\n"
        "holdfast_update(&d, 0.0, open, &e); holdfast_update(&d, 1.0, fixed, &e);\n"
        "return e.finger[HOLDFAST_FINGER_A].state == HOLDFAST_UNKNOWN ? 0 : 1; }\n"
    )
    words = [
        "cc",
        "-std=c99",
        "-O2",
        *WARNINGS,
        tmp_path / "main.c",
        "-o",
        tmp_path / "main",
        "-lm",
    ]
    subprocess.run(words, check=True)
    assert subprocess.run([tmp_path / "main"], check=False).returncode == 0


# One definition: the functions of Python are what is translated.


def uses_of(names, monkeypatch):
    """Return how the headers of some models use each function, and the program of each."""
    uses = defaultdict(list)
    plain = Program.use

    def use(program, function, values):
        uses[function].append((program, list(values)))
        return plain(program, function, values)

    monkeypatch.setattr(Program, "use", use)
    for name in names:
        model, sensors, rate = made(name)
        header_of(model, sensors, rate)
    header_of(*made("rich"), in_contact=True)
    header_of(*made("any-two-sensors"), in_contact=True)
    header_of(*made("noise-floor"), ignore={"pad": [3]})
    header_of(paper(tare="none"), HAND, 150.0)
    header_of(rich(slips=("thumb",), speeds=("thumb",)), *made("rich")[1:])  # fingers differ
    monkeypatch.setattr(Program, "use", plain)
    return uses


def without_statement(tree, place):
    """Return a copy of a function without its statement at a place, and that statement."""
    tree = copy.deepcopy(tree)
    seen = 0
    for parent in ast.walk(tree):
        for field in ("body", "orelse"):
            block = getattr(parent, field, None)
            if not isinstance(block, list):
                continue
            for k, statement in enumerate(block):
                is_docstring = isinstance(statement, ast.Expr) and isinstance(
                    statement.value, ast.Constant
                )
                if is_docstring:
                    continue
                if seen == place:
                    block[k] = ast.copy_location(ast.Pass(), statement)
                    return tree, statement
                seen += 1
    return None, None


def translation(monkeypatch, program, function, values, tree):
    """Return the C text of a function whose tree is another; its error if it has none."""
    monkeypatch.setattr(c_functions, "function_tree", lambda _: (tree, 1))
    try:
        text = Statements(Quiet(program), function, values).definition("hf_tried")
    except Exception as error:
        text = repr(error)
    return text


class Quiet:
    """Program that translates no function that is called."""

    def __init__(self, program):
        self.single, self.time_fields, self.tuples = program.single, frozenset(), set()
        self.program = program

    def call(self, function, values):
        return self.program.call(function, values)

    def call_text(self, function, values):
        return self.program.call_text(function, values)

    def note_store(self, *_):
        pass


def test_a_statement_that_is_deleted_changes_the_header(monkeypatch):
    uses = uses_of([*MODELS], monkeypatch)
    trees = {function: c_functions.function_tree(function)[0] for function in uses}
    assert len(uses) > 60
    unchanged, n_statements = [], 0
    for function, ways in uses.items():
        plain = []  # text of each use, when it is needed
        for place in range(1000):
            tree, statement = without_statement(trees[function], place)
            if tree is None:
                break
            n_statements += 1
            for k, (program, values) in enumerate(ways):
                if k == len(plain):
                    text = translation(monkeypatch, program, function, values, trees[function])
                    plain.append(text)
                if translation(monkeypatch, program, function, values, tree) != plain[k]:
                    break
            else:
                unchanged.append((function.__name__, ast.unparse(statement)))
    assert n_statements > 300
    assert unchanged == []


def test_a_line_of_the_kernel_that_is_deleted_breaks_parity(monkeypatch, tmp_path):
    plain = c_functions.function_tree

    def changed(function):
        tree, first = plain(function)
        if function.__name__ == "add_squares":
            candidates = (without_statement(tree, place) for place in range(9))
            tree = next(t for t, x in candidates if ast.unparse(x).startswith("value +="))
        return tree, first

    monkeypatch.setattr(c_functions, "function_tree", changed)
    python, c = both(built_in("twin"), HAND, 150.0, tmp_path)
    recording = synthetic_recording("made", 3, tuple(HAND))
    with pytest.raises(AssertionError):
        run_recording(python, c, recording)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("return [value]", "List has no translation"),
        ("with value: pass", "With has no translation"),
        ("return value ** 3", "a power other than 2"),
        ("return value.real", "this attribute"),
        ("return print(value)", "a call of this function"),
        ("return math.sin(value)", "a call of this function"),
    ],
)
def test_what_has_no_translation_is_named_with_file_and_line(text, expected, tmp_path):
    source = tmp_path / "kernel_of_test.py"
    source.write_text(f"import math\n\ndef step(value):\n    {text}\n")
    names = {}
    exec(compile(source.read_text(), str(source), "exec"), names)
    with pytest.raises(NotImplementedError, match=expected) as caught:
        Program().call(names["step"], [CNumber("r", "x")])
    assert str(caught.value).startswith(f"{source}:4: ")


def test_a_step_with_sums_in_any_order_has_no_test_for_nan():
    def step(value):
        return math.isnan(value)

    with pytest.raises(NotImplementedError, match="a test for NaN or infinity in sums_in_any"):
        Program().call(sums_in_any_order(step), [CNumber("r", "x")])


@pytest.mark.skipif(platform.machine() != "x86_64" or not shutil.which("gcc"),
                    reason="vector instructions of x86-64, by gcc")  # fmt: skip
@pytest.mark.parametrize("step", ["turn_taxels", "second_differences", "sum_taxels"])
def test_gcc_computes_several_taxels_at_a_time(step, tmp_path):
    model, sensors, rate = made("paper" if step == "sum_taxels" else "twin")
    (tmp_path / "model.h").write_text(header_of(model, sensors, rate).text)
    words = "gcc -std=c99 -O2 -DHOLDFAST_API=extern -x c -S model.h -o model.s"
    subprocess.run(words.split(), check=True, cwd=tmp_path)
    functions = re.split(r"^(?=hf_\w+(?:\.\w+)*:)", (tmp_path / "model.s").read_text(), flags=re.M)
    (text,) = [text for text in functions if text.startswith(f"hf_{step}.")
               or text.startswith(f"hf_{step}:")]  # fmt: skip
    assert "mulpd" in text


LOOPS = {
    "a table": (
        "for place in range(12):\n"
        "        kind = 5 * place & 3\n"
        "        if kind == 2:\n            total += 3.0 * value\n"
        "        elif kind == 1:\n            total -= value * value",
        0,
    ),
    "powers of two": ("while n < 100:\n        if 37 & n:\n            total += value * n\n"
                      "        n = 2 * n", 0),
    "a test that is not known": ("while n < 40:\n        if value > n:\n            n += 7\n"
                                 "        else:\n            n += 3\n        total += n", 1),
    "a break": ("for place in range(5):\n        if place > value:\n            break\n"
                "        total += place", 1),
    "many": ("for place in range(100):\n        if place == 3:\n            total += value", 1),
    "one in the other": ("for row in range(3):\n        for column in range(row, 4):\n"
                         "            total += value * (row + 2 * column)", 0),
    "carried on": ("last = 1.0\n    for place in range(4):\n        if value > place:\n"
                   "            total += last\n            last = 2.0\n        last += 1.0", 1),
}  # fmt: skip
"""Statements, and the number of loops that are left of them in C."""
PRELUDE = """#include <math.h>
#include <stdbool.h>
#include <stdint.h>
typedef double holdfast_real;
#define HF_MATH(name) name
"""


def in_c(text, folder):
    """Return a function of one number in Python and in C, and its source in C."""
    source = folder / "kernel_of_test.py"
    source.write_text(f"def step(value):\n    total, n = 0.5, 1\n    {text}\n    return total\n")
    names = {}
    exec(compile(source.read_text(), str(source), "exec"), names)
    program = Program()
    program.call(names["step"], [CNumber("r", "x")])
    body = program.definitions[0]
    (folder / "step.c").write_text(
        f"{PRELUDE}{body}\ndouble run(double x) {{ return hf_step(x); }}\n"
    )
    command = ["cc", "-std=c99", "-O2", *WARNINGS, "-shared", "-fPIC", "step.c", "-o", "step.so"]
    subprocess.run(command, check=True, cwd=folder)
    run = ctypes.CDLL(str(folder / "step.so")).run
    run.argtypes, run.restype = [ctypes.c_double], ctypes.c_double
    return names["step"], run, body


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_that_is_written_out_computes_the_same(name, tmp_path):
    text, n_loops = LOOPS[name]
    python, c, body = in_c(text, tmp_path)
    assert body.count("for (") + body.count("while (") == n_loops
    for value in (-1.0, 0.0, 0.5, 2.0, 3.7, 11.0, 60.0, 1e300):
        assert c(value) == python(value), value


@pytest.mark.parametrize(
    "text",
    [
        "if value > 1.0:\n        total = 2.0\n    total += 1.0",
        "if value > 1.0:\n        total = 2.0\n    else:\n        n = 3\n    total += n",
        "for k in range(n + int(value)):\n        total += n\n        n = 4\n    total -= n",
    ],
)
def test_a_variable_is_known_only_where_no_branch_has_stored_it(text, tmp_path):
    python, c, _ = in_c(text, tmp_path)
    for value in (0.0, 1.0, 2.0, 5.0):
        assert c(value) == python(value), value


def test_the_header_says_what_it_was_made_of():
    model = built_in("any")
    text = header_of(model, HAND, 150.0).text
    assert f'#define HOLDFAST_MODEL_DIGEST "{model.digest}"' in text
    assert "#define HOLDFAST_N_TAXELS 90" in text
    assert re.search(r"#define HOLDFAST_HEADER_ID 0x[0-9a-f]{8}u", text)
    assert "@" not in text
    assert header_of(model, HAND, 150.0).text == text


def test_the_size_of_the_state_is_that_of_the_struct(tmp_path):
    for single in (False, True):
        header = header_of(paper(), HAND, 150.0, single=single)
        folder = tmp_path / f"single-{single}"  # a library is loaded once from a path
        folder.mkdir()
        c = CDetector(header, folder, HAND, single=single)
        assert 0 <= len(c.memory.raw) - header.state_size < 32


def test_what_cannot_be_exported_is_named():
    with pytest.raises(ModelError, match=r"tare is the interval 1:2 s.*'first' or 'none'"):
        header_of(paper(tare="1:2"), HAND, 150.0)
    assert sys.version_info >= (3, 11)


def test_fast_math_is_an_error(tmp_path):
    (tmp_path / "model.h").write_text(header_of(paper(), *made("paper")[1:]).text)
    command = ["cc", "-std=c99", "-fsyntax-only", "-x", "c", tmp_path / "model.h"]
    subprocess.run(command, check=True)
    for flag in ("-ffast-math", "-ffinite-math-only"):
        shown = subprocess.run([*command, flag], check=False, capture_output=True, text=True)
        assert shown.returncode
        assert "compile without -ffast-math or /fp:fast" in shown.stderr
