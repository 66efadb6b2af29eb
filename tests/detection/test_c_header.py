"""The exported header gives what `Detector` gives, and holds the files of the kernel."""

import platform
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from detection.c_detector import (
    STATES,
    WARNINGS,
    both,
    compare,
    random_samples,
)
from detection.detector.build import sensor as tiny
from detection.models import HAND, MODELS, PATCH, built_in, made, paper, rich
from holdfast.contact import ContactState, Fault
from holdfast.detection import Detector
from holdfast.errors import ModelError
from holdfast.exporters import header_of
from holdfast.synthetic import synthetic_recording

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


# The rich model uses every part of the kernel. The others meet gcc in the tests below.
@pytest.mark.parametrize(
    ("name", "compiler"),
    [*(("rich", each) for each in COMPILERS), ("paper", "clang++"), ("twin", "clang"),
     ("any-newton", "g++")],
)  # fmt: skip
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
            assert float(probability) == pytest.approx(finger.stable_probability, abs=0.0,
                                                       rel=0.0, nan_ok=True)  # fmt: skip


@pytest.mark.parametrize("compiler", ["gcc", "clang++"])
def test_several_source_files_of_a_program_may_include_it(compiler, tmp_path):
    if shutil.which(COMPILERS[compiler][0]) is None:
        pytest.skip(f"{COMPILERS[compiler][0]} is not installed")
    (tmp_path / "model.h").write_text(header_of(*made("twin")).text)
    for name, body in (
        ("main", "int other(holdfast_detector *d);\nint main(void)\n{\n"
                 "    static holdfast_detector d;\n    holdfast_init(&d);\n"
                 "    return other(&d);\n}\n"),
        ("other", "int other(holdfast_detector *d);\nint other(holdfast_detector *d)\n{\n"
                  "    static holdfast_real readings[HOLDFAST_N_TAXELS][3];\n"
                  "    holdfast_estimate e;\n"
                  "    return holdfast_update(d, 1.0, readings, &e);\n}\n"),
    ):  # fmt: skip
        (tmp_path / f"{name}.c").write_text(f'#include "model.h"\n{body}')
    words = [*COMPILERS[compiler], *WARNINGS, f"-I{tmp_path}", tmp_path / "main.c"]
    subprocess.run([*words, tmp_path / "other.c", "-o", tmp_path / "run", "-lm"], check=True)
    assert subprocess.run([tmp_path / "run"], check=False).returncode == 0


@pytest.mark.parametrize("name", MODELS)
def test_random_samples_give_the_same(name):
    model, sensors, rate = made(name)
    counts = next(iter(sensors.values())).unit == "count"
    python, c = both(model, sensors, rate)
    seen = Counter()
    # All that goes wrong in a random stream begins before sample 1000, but a taxel that stops.
    n = 2500 if name == "rich" else 1000
    for samples, time in random_samples(np.random.default_rng(2), sensors, rate, n, counts):
        hand = compare(python, c, samples, time)
        if hand is not None:
            seen.update(x.state for x in hand.fingers.values())
            seen.update(fault for x in hand.fingers.values() for fault in x.faults)
    assert {ContactState.UNKNOWN, ContactState.UNSTABLE, Fault.REPEATED} <= set(seen)
    assert len(seen) > 5 and (Fault.OFFSET in seen) == counts


def test_a_sensor_of_more_than_64_taxels_gives_the_same():
    skin = tiny(88, "skin", limits=(0.0, 65_535.0))
    python, c = both(built_in("any"), {"skin": skin, "pad": PATCH}, 100.0)
    rng, named = np.random.default_rng(0), set()
    for k in range(400):
        skin_sample = np.rint(30_000 + rng.normal(scale=3, size=(88, 3)))
        skin_sample[87, 2] = np.nan if k > 200 else 30_000
        samples = {"skin": skin_sample, "pad": skin_sample[:16] + 7}
        named.add(compare(python, c, samples, k / 100).fingers["skin"].faulty_taxels)
    assert (87,) in named


def test_single_precision_is_within_its_tolerance():
    recording = synthetic_recording("made", 3, tuple(HAND))
    python, c = both(built_in("twin"), HAND, 150.0, single=True)
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
    # without -fno-pic the tables, which hold addresses, are in a section that a loader writes to
    command = ["cc", "-std=c99", "-O2", "-fno-pic", "-DHOLDFAST_API=extern", "-x", "c", "-c"]
    subprocess.run([*command, tmp_path / "model.h", "-o", library], check=True)
    listed = subprocess.run(["nm", library], check=True, capture_output=True, text=True).stdout
    symbols = [line.split()[-2:] for line in listed.splitlines()]
    outside = {name for kind, name in symbols if kind == "U"}
    maths = {"exp", "expm1", "log", "tanh", "sqrt", "nextafter", "fabs", "copysign", "lrint"}
    assert outside <= maths | {"memset", "memcpy", "memmove", "_GLOBAL_OFFSET_TABLE_"}
    assert not [name for kind, name in symbols if kind in "BbDdC"]  # data that can change


@pytest.mark.skipif(platform.machine() != "x86_64", reason="an option of compilers for x86-64")
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_no_multiplication_is_joined_with_an_addition(compiler, tmp_path):
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    (tmp_path / "model.h").write_text(header_of(paper(), HAND, 150.0).text)
    words = [compiler, "-std=gnu99", "-O2", "-mfma", "-DHOLDFAST_API=extern", "-x", "c", "-S"]
    subprocess.run([*words, tmp_path / "model.h", "-o", tmp_path / "model.s"], check=True)
    assert "vfmadd" not in (tmp_path / "model.s").read_text()


def test_a_detector_without_header_or_of_another_is_refused():
    _, c = both(paper(), HAND, 150.0)
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


def test_the_header_says_what_it_was_made_of():
    model = built_in("any")
    text = header_of(model, HAND, 150.0).text
    assert f'#define HOLDFAST_MODEL_DIGEST "{model.digest}"' in text
    assert "#define HOLDFAST_N_TAXELS 90" in text
    assert re.search(r"#define HOLDFAST_HEADER_ID 0x[0-9a-f]{8}u", text)
    assert "@" not in text
    assert header_of(model, HAND, 150.0).text == text


def test_what_cannot_be_exported_is_named():
    with pytest.raises(ModelError, match="1:2 s"):
        header_of(paper(tare="1:2"), HAND, 150.0)


def test_fast_math_is_an_error(tmp_path):
    (tmp_path / "model.h").write_text(header_of(paper(), *made("paper")[1:]).text)
    command = ["cc", "-std=c99", "-fsyntax-only", "-x", "c", tmp_path / "model.h"]
    subprocess.run(command, check=True)
    for flag in ("-ffast-math", "-ffinite-math-only"):
        shown = subprocess.run([*command, flag], check=False, capture_output=True, text=True)
        assert shown.returncode
        assert "-ffast-math" in shown.stderr
