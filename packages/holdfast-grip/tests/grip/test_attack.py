"""A short run of the attacks on the grip loop; `benchmarks/attack.py grip` is the long one."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ATTACK = Path(__file__).parents[4] / "benchmarks" / "attack.py"


@pytest.fixture(scope="module")
def results():
    words = [sys.executable, str(ATTACK), "grip", "--scale", "0.02", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return {one["attack"]: one for one in map(json.loads, done.stdout.splitlines())}


def test_no_attack_gives_a_wrong_command_or_an_exception(results):
    assert len(results) == 4
    assert [one for one in results.values() if one["n_wrong"] or one["n_foreign"]] == []


def test_some_faults_are_found_and_some_runs_are_healthy(results):
    for name in ("grip: clocks and numbers", "grip: bursts"):
        assert results[name]["n_accepted"] > 0
        assert results[name]["n_refused"] > 0


def test_a_stopped_watchdog_ends_every_loop(results):
    found = results["grip: stopped watchdogs"]
    assert found["n_refused"] == found["n_tried"] > 0
