"""What is loaded to detect: nothing of the extras."""

import subprocess
import sys

import pytest

DETECTING = ("holdfast.detection", "holdfast.live.stream_detector")
OF_EXTRAS = (
    "jinja2", "joblib", "matplotlib", "mujoco", "pyarrow", "scipy", "sklearn",
)  # fmt: skip
PROGRAM = """
import sys
sys.modules.update(dict.fromkeys({names}))  # None: an import of it fails
import {module}
"""


def run(module):
    program = PROGRAM.format(names=OF_EXTRAS, module=module)
    command = [sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize(
    "module", [*DETECTING, "holdfast.metrics", "holdfast.training.classifiers"]
)
def test_to_detect_no_package_of_an_extra_is_needed(module):
    assert run(module).stderr == ""


def test_a_hidden_package_is_noticed():
    assert "sklearn" in run("holdfast.training.estimator").stderr
