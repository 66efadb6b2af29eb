"""Arrays of containers: by path or by shape, with their times; else the command that works."""

import json
import re
import sys

import numpy as np
import pytest

from holdfast.errors import MissingExtra, RecordingError
from holdfast.io import import_recordings
from holdfast.io.importers.arrays import arrays_of_hdf5
from holdfast.io.importers.columns import Columns
from holdfast.io.proposals import ProposalError
from holdfast.sensors import sensor

SKIN = sensor("anyskin")
N = 120
TIMES = np.arange(N) / 100
READINGS = np.random.default_rng(3).normal(0, 100, (N, 5, 3)).round(2)
FLAT = READINGS.reshape(N, 15)
ALONE = {"a": {"finger1": READINGS}}


def npz(path, **arrays):
    np.savez(path.with_suffix(".npz"), **arrays)
    return path.with_suffix(".npz")


def npy(path, values):
    np.save(path.with_suffix(".npy"), values)
    return path.with_suffix(".npy")


def lines(path, records, suffix=".jsonl"):
    text = "".join(json.dumps(record) + "\n" for record in records)
    path.with_suffix(suffix).write_text(text)
    return path.with_suffix(suffix)


def mat(path, **arrays):
    scipy = pytest.importorskip("scipy.io", reason="scipy is not installed")
    scipy.savemat(path.with_suffix(".mat"), arrays)
    return path.with_suffix(".mat")


def mat73(path, arrays):
    """Write arrays as MATLAB 7.3 does: HDF5 after 512 bytes, with the axes in reverse order."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    path = path.with_suffix(".mat")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file[name] = np.atleast_2d(values).T
    data = bytearray(path.read_bytes())
    data[:116] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116)
    path.write_bytes(data)
    return path


def hdf5(path, arrays, attributes=()):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    path = path.with_suffix(".hdf5")
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values
        for name, key, value in attributes:
            file[name].attrs[key] = value
    return path


def parquet(path, columns):
    pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    pq = pytest.importorskip("pyarrow.parquet")
    arrays = {k: pa.array(v.tolist() if np.ndim(v) > 1 else v) for k, v in columns.items()}
    pq.write_table(pa.table(arrays), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def samples():
    return zip(TIMES.tolist(), FLAT.tolist(), strict=True)


FIELDS = np.zeros(N, dtype=[("t", "f8"), ("force", "f4", (5, 3))])
FIELDS["t"], FIELDS["force"] = TIMES, READINGS
GRID = np.arange(20 * 4 * 4 * 3.0).reshape(20, 4, 4, 3)
DEMOS = {
    name: values
    for k in range(11)
    for name, values in {
        f"data/demo_{k}/obs/tactile": READINGS + k,
        f"data/demo_{k}/obs/image": np.zeros((N, 2, 2, 3), np.uint8),
        f"data/demo_{k}/actions": np.zeros((N, 7)),
        f"data/demo_{k}/timestamp": TIMES,
    }.items()
}
NOISE = np.random.default_rng(8).normal(0, 1, (N, 5, 3))
TAXELS = [{"id": k, "dx": 0.1, "dy": 0.2, "dz": 0.3} for k in range(5)]

ONE = {
    "samples, taxels, axes": lambda p: npz(p, tactile=READINGS, t=TIMES),
    "samples, numbers": lambda p: npz(p, tactile=FLAT, t=TIMES),
    "numbers, samples": lambda p: npz(p, tactile=FLAT.T, time=TIMES),
    "ms": lambda p: npz(p, m=READINGS, time_ms=1e3 * TIMES),
    "taxels, axes, samples, ns": lambda p: npz(
        p, m=READINGS.transpose(1, 2, 0), stamps_ns=(1e9 * TIMES).astype(int) + 10**18
    ),
    "beside other arrays": lambda p: npz(
        p, tactile=READINGS, wrench=np.zeros((N, 6)), q=np.zeros((N, 7)), t=TIMES[:, None]
    ),
    "a rate": lambda p: npz(p, tactile=READINGS, fs=100),
    "npy of fields": lambda p: npy(p, FIELDS),
    "MATLAB 5": lambda p: mat(p, data={"F": READINGS, "t": TIMES}),
    "MATLAB 5, columns": lambda p: mat(p, F=FLAT.T, t=TIMES[:, None]),
    "MATLAB 7.3": lambda p: mat73(p, {"F": FLAT, "t": TIMES}),
    "MATLAB 7.3, axes": lambda p: mat73(p, {"F": READINGS, "t": TIMES}),
    "HDF5": lambda p: hdf5(p, {"log/tactile": READINGS, "log/time": TIMES}),
    "HDF5, time above": lambda p: hdf5(p, {"log/skin/tactile": READINGS, "log/time": TIMES}),
    "HDF5, rate": lambda p: hdf5(p, {"F": READINGS}, [("F", "sample_rate", 100.0)]),
    "HDF5 of fields": lambda p: hdf5(p, {"log": FIELDS}),
    "Parquet of lists": lambda p: parquet(p, {"t": TIMES, "tactile": FLAT, "n": ["a"] * N}),
    "Parquet of nested lists": lambda p: parquet(p, {"t": TIMES, "tactile": READINGS}),
    "Parquet of columns": lambda p: parquet(
        p, {"t": TIMES, **{f"B{'xyz'[n % 3]}{n // 3}": FLAT[:, n] for n in range(15)}}
    ),
    "Parquet with dates": lambda p: parquet(
        p, {"time": (1e9 * TIMES).astype("M8[ns]") + 10**18, "tactile": FLAT}
    ),
    "lines": lambda p: lines(p, ({"t": t, "data": x} for t, x in samples())),
    "lines of points": lambda p: lines(
        p,
        (
            {"ts": 1e3 * t, "s": [dict(zip("xyz", x[3 * k :][:3], strict=True)) for k in range(5)]}
            for t, x in samples()
        ),
        ".txt",
    ),
    "lines of two kinds": lambda p: lines(
        p,
        (
            {"type": kind, "time": t, "data": x if kind == "tactile" else x[:6]}
            for t, x in samples()
            for kind in ("tactile", "wrench")
        ),
    ),
    "lines of numbers": lambda p: lines(
        p,
        (
            {"time": t, **{f"{'xyz'[n % 3]}{n // 3}": value for n, value in enumerate(x)}}
            for t, x in samples()
        ),
    ),
    "a document": lambda p: lines(p, [{"time": TIMES.tolist(), "f": READINGS.tolist()}], ".json"),
}  # fmt: skip


def imported(file, sensors, columns=None, **words):
    recordings = import_recordings(file, sensors=sensors, columns=columns, **words)
    return {one.name: dict(one.modules) for one in recordings}


def check(found, expected):
    assert list(found) == list(expected)
    for name, modules in expected.items():
        assert list(found[name]) == list(modules)
        for module, readings in modules.items():
            np.testing.assert_allclose(found[name][module].readings, readings, atol=1e-4)
            np.testing.assert_allclose(np.diff(found[name][module].times), 0.01, atol=1e-5)


AT_ONCE = {
    "samples, taxels, axes", "taxels, axes, samples, ns", "beside other arrays", "a rate", "ms",
    "npy of fields", "MATLAB 7.3, axes", "HDF5", "HDF5, time above", "HDF5, rate", "HDF5 of fields",
    "MATLAB 5", "Parquet of nested lists", "Parquet of columns", "lines of numbers", "a document",
}  # fmt: skip
"""Arrays whose names and last axes say what they are; all others are proposed."""


@pytest.mark.parametrize("name", ONE)
def test_one_array_that_fits(tmp_path, name):
    reported, file = [], ONE[name](tmp_path / "a")
    if name not in AT_ONCE:
        with pytest.raises(ProposalError):
            imported(file, {"*": SKIN})
    accept = name not in AT_ONCE
    check(imported(file, {"*": SKIN}, report=reported.append, accept=accept), ALONE)
    assert len(reported) == 1
    assert "100 Hz" in reported[0]


DEMO_NAMES = {f"a-demo_{k}": {"finger1": READINGS + k} for k in range(11)}
SEVERAL = {
    "two modules": (lambda p: npz(p, F=np.stack([READINGS, -READINGS], 1), t=TIMES), ("*",),
                    {"a": {"finger1": READINGS, "finger2": -READINGS}}),
    "two arrays": (lambda p: npz(p, l=READINGS, r=-READINGS, t=TIMES), ("l", "r"),
                   {"a": {"l": READINGS, "r": -READINGS}}),
    "arrays of fingers": (lambda p: npz(p, left=READINGS, right=-READINGS, t=TIMES), ("*",),
                          {"a": {"left": READINGS, "right": -READINGS}}),
    "normal and shear": (lambda p: npz(p, f=READINGS[..., 2], s=READINGS[..., :2], t=TIMES),
                         ("s+f",), ALONE),
    "episodes first": (lambda p: npz(p, F=np.stack([READINGS, -READINGS, 2 * READINGS]), t=TIMES),
                       ("F",),
                       {f"a-{k}": {"finger1": s * READINGS} for k, s in ((1, 1), (2, -1), (3, 2))}),
    "episodes with times": (lambda p: npz(p, F=np.stack([READINGS, -READINGS]),
                                          t=np.stack([TIMES, TIMES + 9])), ("*",),
                            {"a-1": {"finger1": READINGS}, "a-2": {"finger1": -READINGS}}),
    "demonstrations": (lambda p: hdf5(p, DEMOS), ("*",), DEMO_NAMES),
    "by the end of the path": (lambda p: hdf5(p, DEMOS), ("obs/tactile",), DEMO_NAMES),
    "by a pattern": (lambda p: hdf5(p, DEMOS), ("data/*/obs/tactile",), DEMO_NAMES),
    "by a group": (lambda p: hdf5(p, DEMOS), ("data/demo_3",), {"a": {"finger1": READINGS + 3}}),
    "structs of MATLAB": (lambda p: mat(p, trial=[{"t": TIMES, "F": s * READINGS} for s in (1, 2)]),
                          ("*",), {"a-0": {"finger1": READINGS}, "a-1": {"finger1": 2 * READINGS}}),
    "sensors by lines": (lambda p: lines(p, ({"time": t, "sensor": name, "data": x}
                                             for t, x in samples() for name in ("left", "right"))),
                         ("data",), {"a": {"left": READINGS, "right": READINGS}}),
}  # fmt: skip


@pytest.mark.parametrize(("write", "keys", "expected"), SEVERAL.values(), ids=SEVERAL)
def test_several_of_everything(tmp_path, write, keys, expected):
    check(imported(write(tmp_path / "a"), dict.fromkeys(keys, SKIN)), expected)


def test_columns_say_the_rate_the_signs_and_the_recordings(tmp_path):
    extra = np.column_stack([FLAT, np.tile([1921.0, 2664.0], (N, 1))])
    file = npy(tmp_path / "a", extra)
    check(imported(file, {"*": SKIN}, "time=100Hz,taxels=1..15"), ALONE)
    file = npz(tmp_path / "a", F=READINGS, k=np.repeat([3, 4], N // 2), t=TIMES)
    half = {f"a-{k}": {"finger1": READINGS[60 * k - 180 :][:60]} for k in (3, 4)}
    check(imported(file, {"*": SKIN}, "episode=k"), half)
    turned = {"a": {"finger1": READINGS * [1, -1, -1]}}
    check(imported(file, {"F": SKIN}, Columns(axes=(1, -2, -3))), turned)
    six = npz(tmp_path / "a", F=np.concatenate([READINGS[..., 2:], READINGS], axis=-1), t=TIMES)
    check(imported(six, {"F": SKIN}, Columns(axes=(2, 3, 1))), ALONE)


def test_rows_of_a_grid_of_matlab_keep_their_order(tmp_path):
    file = mat73(tmp_path / "a", {"F": GRID, "t": np.arange(20) / 100})
    found = imported(file, {"F": sensor("uskin-4x4")})
    np.testing.assert_array_equal(found["a"]["finger1"].readings, GRID.reshape(20, 16, 3))


REFUSED = {
    "no times": (lambda p: npz(p, F=READINGS), ("F",), "time=100Hz"),
    "fingers without times": (lambda p: hdf5(p, {"finger1/F": READINGS, "finger2/F": READINGS}),
                              ("*",), "time=100Hz"),
    "another path": (lambda p: hdf5(p, DEMOS), ("tactil",), "'tactil'"),
    "another sensor": (lambda p: npz(p, F=READINGS[:, :4], t=TIMES), ("F",), "(120, 4, 3)"),
    "windows": (lambda p: npz(p, F=READINGS.reshape(12, 10, 5, 3), t=TIMES[:12]), ("F",),
                "numpy.reshape"),
    "axis, taxel": (lambda p: npz(p, F=READINGS.swapaxes(1, 2), t=TIMES), ("F",),
                    "numpy.swapaxes"),
    "the time first": (lambda p: npy(p, np.column_stack([TIMES, FLAT])), ("*",),
                       "time=1,taxels=2..16"),
    "normal force": (lambda p: npz(p, F=READINGS[..., 2], t=TIMES), ("F",), "three axes"),
    "shear": (lambda p: npz(p, F=READINGS[..., :2], t=TIMES), ("*",), "three axes"),
    "no reading": (lambda p: npz(p, torque=READINGS, t=TIMES), ("*",), "torque is a torque"),
    "two clocks": (lambda p: hdf5(p, {"l/F": READINGS, "l/t": TIMES, "r/F": READINGS,
                                      "r/t": TIMES + 90}), ("l/F", "r/F"), "do not overlap"),
    "number 4": (lambda p: npz(p, F=READINGS, t=TIMES), ("F", (1, 2, 4)), "number 4"),
    "a pickle": (lambda p: (p.with_suffix(".pkl"), p.with_suffix(".pkl").write_bytes(b"x"))[0],
                 ("*",), "numpy.savez('a.npz', **arrays)"),
    "objects": (lambda p: npy(p, np.array([{}])), ("*",), "a.npy is a pickle"),
    "nothing": (lambda p: (p.with_suffix(".npz"), p.with_suffix(".npz").touch())[0], ("*",),
                "a.npz is empty"),
    "zarr": (lambda p: (p.mkdir(), (p / ".zgroup").touch(), p)[2], ("data/F",), "zarr.open('a')"),
}  # fmt: skip


@pytest.mark.parametrize(("write", "keys", "text"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_read_has_the_command_that_works(tmp_path, monkeypatch, write, keys, text):
    monkeypatch.chdir(tmp_path)
    file = write(tmp_path / "a").relative_to(tmp_path)
    axes = next((key for key in keys if isinstance(key, tuple)), None)
    keys = [key for key in keys if isinstance(key, str)]
    with pytest.raises(RecordingError, match=re.escape(text)) as caught:
        imported(file, dict.fromkeys(keys, SKIN), Columns(axes=axes))
    assert "\n" not in str(caught.value)
    assert not isinstance(caught.value, ProposalError)


POINTS = ({"t": t, "p": [row | {"fx": 1.0, "fy": 0.0, "fz": 2.0} for row in TAXELS]} for t in TIMES)
WRENCH = np.concatenate([READINGS, 0.1 * NOISE], axis=-1)
NAMED = {f"{axis}{k}": READINGS[:, k, j] for k in range(5) for j, axis in enumerate("xyz")}
PROPOSED = {
    "without a sensor": (lambda p: npz(p, F=READINGS, t=TIMES), (), ["--sensor", "anyskin"]),
    "two that fit": (lambda p: npz(p, force=READINGS, raw=READINGS, t=TIMES), ("*",),
                     ["--array", "force=*"]),
    "force and displacement": (lambda p: lines(p, POINTS), ("*",), ["--array", "p/f=*"]),
    "flat fingers": (lambda p: npz(p, left=FLAT, right=FLAT, t=TIMES), ("*",),
                     ["--array", "left=*", "--array", "right=*"]),
    "force and torque": (lambda p: npz(p, F=WRENCH, t=TIMES), ("F",),
                         ["--array", "F=F", "--axes=1,2,3"]),
    "displacement and force": (lambda p: npz(p, F=np.concatenate([READINGS / 10, READINGS], -1),
                                             t=TIMES), ("*",), ["--array", "F=*", "--axes=4,5,6"]),
    "two that fit, without a sensor": (lambda p: npz(p, force=READINGS, raw=READINGS, t=TIMES), (),
                                       ["--array", "force=anyskin"]),
    "flat, without a sensor": (lambda p: npz(p, F=FLAT, t=TIMES, q=FLAT[:, :7]), (),
                               ["--array", "F=anyskin"]),
    "a wide table": (lambda p: parquet(p, {"t": TIMES} | NAMED), (), ["--sensor", "anyskin"]),
}  # fmt: skip


@pytest.mark.parametrize(("write", "keys", "options"), PROPOSED.values(), ids=PROPOSED)
def test_what_is_not_said_is_proposed(tmp_path, write, keys, options):
    with pytest.raises(ProposalError) as caught:
        imported(write(tmp_path / "a"), dict.fromkeys(keys, SKIN))
    assert caught.value.proposal.options({}) == options


def test_a_baseline_that_was_subtracted_leaves_out_the_range(tmp_path):
    skin, reported = sensor("uskin-4x4"), []
    readings = np.tile(READINGS[:, :4].round(), (1, 4, 1))
    modules = imported(
        npz(tmp_path / "a", F=readings, t=TIMES), {"F": skin}, report=reported.append
    )
    assert modules["a"]["finger1"].sensor.range is None
    assert "beyond the range 0 to 65535 of uskin-4x4" in reported[0]
    kept = np.where(np.arange(N)[:, None, None] < 0.4 * N, -1.0, readings + 32768)
    modules = imported(npz(tmp_path / "a", F=kept, t=TIMES), {"F": skin}, Columns(missing="none"))
    assert modules["a"]["finger1"].sensor == skin


def external_link(content, other):
    import h5py

    content["F"] = h5py.ExternalLink(str(other), "F")


def virtual(content, other):
    import h5py

    layout = h5py.VirtualLayout(READINGS.shape, "f8")
    layout[:] = h5py.VirtualSource(str(other), "F", READINGS.shape)
    content.create_virtual_dataset("F", layout)


def soft_link(content, other):
    import h5py

    content["G"] = READINGS
    content["F"] = h5py.SoftLink("/G")


@pytest.mark.parametrize("store", [external_link, virtual, soft_link])
def test_nothing_outside_of_the_file_is_read(tmp_path, store):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    other = hdf5(tmp_path / "other", {"F": READINGS})
    file = hdf5(tmp_path / "a", {"time": TIMES})
    with h5py.File(file, "a") as content:
        store(content, other)
    with pytest.raises(RecordingError, match="F is no array stored in this file"):
        imported(file, {"F": SKIN})


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtra, match="hdf5"):
        arrays_of_hdf5(tmp_path / "a.h5")


def test_an_array_that_unpacks_to_more_than_the_memory(tmp_path):
    file = npz(tmp_path / "a", F=READINGS)
    np.savez_compressed(file, F=np.zeros((73 * 10**6, 15), np.uint8), t=TIMES)
    with pytest.raises(RecordingError, match="memory"):
        imported(file, {"F": SKIN})


def test_a_folder_with_tables_is_one_of_tables(tmp_path):
    npz(tmp_path / "a", F=READINGS, t=TIMES)
    assert list(imported(tmp_path, {"*": SKIN})) == ["a"]
    names = ",".join(["time", *(f"B{a}{k}" for k in range(5) for a in "xyz")])
    np.savetxt(
        tmp_path / "b.csv", np.column_stack([TIMES, FLAT]), "%.3f", ",", header=names, comments=""
    )
    assert list(imported(tmp_path, {"*": SKIN})) == ["b"]


def test_only_the_last_line_of_json_may_be_cut(tmp_path):
    file = lines(tmp_path / "a", ({"t": t, "data": x} for t, x in samples()))
    text = file.read_text()
    file.write_text(text[:-30])
    module = imported(file, {"data": SKIN})["a"]["finger1"]
    np.testing.assert_array_equal(module.readings, READINGS[:-1])
    file.write_text(text.replace('"data"', '"data', 1))
    with pytest.raises(RecordingError, match="record 1"):
        imported(file, {"data": SKIN})
