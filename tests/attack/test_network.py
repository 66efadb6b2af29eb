"""A short run of the attacks from the network; `benchmarks/attack.py network` is the long one."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ATTACK = Path(__file__).parents[2] / "benchmarks" / "attack.py"


@pytest.fixture(scope="module")
def results():
    words = [sys.executable, str(ATTACK), "network", "--scale", "0.003", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return {one["attack"]: one for one in map(json.loads, done.stdout.splitlines())}


def test_no_attack_gives_a_wrong_value_or_an_exception_that_is_not_documented(results):
    assert [one for one in results.values() if one["n_wrong"] or one["n_foreign"]] == []


@pytest.mark.parametrize(
    "name",
    ["XELA 1.7: packets", "XELA 1.8: packets", "ROS 2 CDR: messages", "serial, binary: pieces of "
     "bytes", "serial, text: pieces of bytes", "hostile XELA servers", "serve: odd requests"],
)  # fmt: skip
def test_some_inputs_are_accepted_and_some_refused(results, name):
    """An attack that is always refused, or never, tests nothing."""
    assert results[name]["n_accepted"] > 0
    assert results[name]["n_refused"] > 0


@pytest.mark.parametrize("kind", ["half-open connections", "connections without a byte"])
def test_other_clients_are_answered_while_connections_are_held(results, kind):
    found = results[f"serve: {kind}"]
    assert found["n_accepted"] == found["n_tried"] > 0
