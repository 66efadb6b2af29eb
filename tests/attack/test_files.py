"""A short run of the attacks by files; `benchmarks/attack.py files` is the long one."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ATTACK = Path(__file__).parents[2] / "benchmarks" / "attack.py"
SHORT = """
import sys
sys.path.insert(0, {folder!r})
from attack import documents, imports, recordings
import json

results = [recordings.attack_damage(120, suffix, name, damage)
           for suffix in (".parquet", ".mcap") for name, damage in recordings.DAMAGES.items()]
results += [recordings.attack_headers(40, suffix) for suffix in (".parquet", ".mcap")]
results += [recordings.attack_sealed(60), recordings.attack_kills(2)]
results += [documents.attack_models(60), documents.attack_labels(60)]
results += [documents.attack_label_bits(200), documents.attack_definitions(200)]
results += documents.attack_others(40)
results += imports.attack_imports(40)
results += [imports.attack_videos(30)]
for result in results:
    print(json.dumps(result.document()))
"""


@pytest.fixture(scope="module")
def results():
    code = SHORT.format(folder=str(ATTACK.parent))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return {one["attack"]: one for one in map(json.loads, done.stdout.splitlines())}


def test_no_file_gives_a_wrong_value_or_an_exception_that_is_not_documented(results):
    assert [one for one in results.values() if one["n_wrong"] or one["n_foreign"]] == []


@pytest.mark.parametrize(
    "name",
    [
        "recording, .mcap: cut",
        "recording, .mcap: cut, then damaged",
        "recording, .parquet: damaged, with a valid checksum",
        "model files",
        "label files without a digest",
        "objects, TOML",
        "labels, CSV",
        "ROS definitions, and messages by them",
        "import lerobot data, .parquet",
        "videos, .mp4",
        "import lerobot episodes, .parquet",
        "import arrays, .mat",
        "import arrays, .jsonl",
    ],
)
def test_some_files_are_accepted_and_some_refused(results, name):
    """An attack that is always refused, or never, tests nothing."""
    assert results[name]["n_refused"] > 0
    assert results[name]["n_accepted"] > 0


def test_a_damaged_complete_recording_is_always_refused(results):
    for name in ("recording, .parquet: flipped bits", "recording, .mcap: flipped bits"):
        assert results[name]["n_accepted"] == 0
        assert results[name]["n_refused"] == 120
    assert results["label files: flipped bits"]["n_wrong"] == 0
