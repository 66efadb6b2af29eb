"""Small files that expand: each is read by the command line in a process with limits of its own.

`benchmarks/attack/expansions.py` makes the files; `benchmarks/attack.py files` reads them too.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs limits of Linux")

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NAMES = [
    "recording, schemas",
    "recording, records without content",
    "recording, header of lists",
    "recording, sparse .mcap",
    "recording, sparse .parquet",
    "bag, .mcap, records without content",
    "bag, .mcap, messages of one time",
    "bag, .mcap, topics of one definition",
    "bag, .mcap, sparse",
    "bag, .db3, sparse",
    "bag, .db3, generated column",
    "bag, .db3, view",
    "bag, .db3, shared pages",
    "bag, folder, packed messages",
    "bag, folder, packed file",
    "bag, folder, metadata that repeat",
    "bag, .bag, sparse",
    "bag, .bag, bz2",
    "bag, .bag, lz4",
    "bag, .bag, two chunks by turns",
    "bag, .bag, records before each message",
    "bag, .bag, index that repeats",
    "csv, sparse",
    "csv, sparse, without a header",
    "csv, sparse, gtac",
    "csv, sparse, xela-log",
    "csv, columns to guess from",
    "csv, a name to guess from",
    "csv, two million columns",
    "csv, two million rows that are wrong",
    "csv, semicolons, a million columns",
    "tensor, sparse",
    "tensor, packed",
    "tensor, a size that is too large",
    "tensor, one member many times",
    "HDF5, sparse",
    "HDF5, groups in groups",
    "HDF5, links to one array",
    "HDF5, arrays without values",
    "HDF5, a chunk that is too large",
    "HDF5, a chunk that is packed twice",
]

CODE = """
import json, sys
sys.path.insert(0, {folder!r})
from attack import expansions
for result in expansions.attack_expansions([{name!r}]):
    print(json.dumps(result.document()))
"""


@pytest.mark.parametrize("name", NAMES)
def test_a_small_file_that_expands_is_refused(name):
    code = CODE.format(folder=str(BENCHMARKS), name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    if not done.stdout:
        pytest.skip("its package is not installed")
    found = json.loads(done.stdout)
    assert (found["n_refused"], found["n_foreign"], found["n_wrong"]) == (1, 0, 0), found["note"]


def test_every_file_is_tried():
    code = CODE.format(folder=str(BENCHMARKS), name="").partition("for ")[0]
    code += "print(json.dumps(list(expansions.FILES)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == NAMES
