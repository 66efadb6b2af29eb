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
sys.path.insert(0, str(BENCHMARKS))
try:
    from attack.expansions import FILES
finally:
    sys.path.remove(str(BENCHMARKS))

CODE = """
import json, sys
sys.path.insert(0, {folder!r})
from attack import expansions
for result in expansions.attack_expansions([{name!r}]):
    print(json.dumps(result.document()))
"""


@pytest.mark.parametrize("name", FILES)
def test_a_small_file_that_expands_is_refused(name):
    code = CODE.format(folder=str(BENCHMARKS), name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    if not done.stdout:
        pytest.skip("its package is not installed")
    found = json.loads(done.stdout)
    assert (found["n_refused"], found["n_foreign"], found["n_wrong"]) == (1, 0, 0), found["note"]
    assert "does not fit into memory" not in found["note"]
