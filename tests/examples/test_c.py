"""The examples around the exported header, compiled and run; ROS and Arduino have stand-ins."""

import json
import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from holdfast.detection import Model
from holdfast.exporters import fingers_of_sensor, header_of
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None or shutil.which("c++") is None, reason="no C compiler is installed"
)
FOLDER = Path(__file__).parents[2] / "examples" / "c"
STUBS = Path(__file__).with_name("stubs")
WARNINGS = ("-Wall", "-Wextra", "-pedantic", "-Werror", "-O2")


def built(folder, model, sensor, fingers, source, *words, single=False):
    """Return the program of a source, with the header of a model."""
    sensors = fingers_of_sensor(sensor, fingers)
    rate = next(iter(sensors.values())).rate
    header = header_of(Model.load(model), sensors, rate, single=single)
    (folder / "model.h").write_text(header.text)
    command = [*words, *WARNINGS, f"-I{folder}", f"-I{STUBS}", source, "-o", folder / "run", "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return folder / "run"


def packet(k, time, readings):
    data = ",".join(f"{int(value):04X}" for value in readings.ravel())
    sensor = {"time": time, "sensor": "1", "data": data, "model": "uspr-dsf", "taxels": 30}
    return json.dumps({"message": k, "time": time, "sensors": 1, "type": "routine", "1": sensor})


def test_xela_packets_become_states(tmp_path):
    program = built(tmp_path, "builtin:twin", "uskin-curved", "1", FOLDER / "xela_states.c",
                    "cc", "-std=c99")  # fmt: skip
    module = synthetic_recording("made", 1, ("index",)).modules["index"]
    lines = [
        packet(k, 1.7e9 + time, readings)
        for k, (time, readings) in enumerate(zip(module.times, module.readings, strict=True))
    ]
    text = "\n".join([*lines, lines[-1], "{}"]) + "\n"
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    states = [line.split()[-1] for line in done.stdout.splitlines()]
    assert states[0] == "NO_CONTACT" and {"UNSTABLE", "STABLE"} <= set(states)
    assert done.stderr.count("ignored") == 2


def test_a_controller_of_ros2_control_asks_for_force(tmp_path):
    main = tmp_path / "main.cpp"
    main.write_text(
        f'#include "{FOLDER / "slip_controller.cpp"}"\n'
        "#include <cstdio>\n#include <cstdlib>\n"
        "int main() {\n"
        "  holdfast_example::SlipController c;\n"
        "  if (c.on_init() != controller_interface::CallbackReturn::SUCCESS) return 1;\n"
        "  c.state_interfaces_.resize(c.state_interface_configuration().names.size());\n"
        "  c.command_interfaces_.resize(c.command_interface_configuration().names.size());\n"
        "  c.on_activate(rclcpp_lifecycle::State());\n"
        "  for (int k = 0; k < 600; ++k) {\n"
        "    for (auto & x : c.state_interfaces_)\n"
        "      x.value = 33000 + rand() % 5 + (k > 300 ? rand() % 900 : 0);\n"
        "    c.update(rclcpp::Time{k / 150.0}, rclcpp::Duration());\n"
        '    if (k == 299 || k == 599) std::printf("%g ", c.command_interfaces_[0].value);\n'
        "  }\n}\n"
    )
    program = built(tmp_path, "builtin:twin", "uskin-curved", "4", main, "c++", "-std=c++17")
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "1"]


def test_an_arduino_has_a_fingertip(tmp_path):
    main = tmp_path / "main.cpp"
    main.write_text(
        f'#include "{FOLDER / "fingertip.ino"}"\n'
        "#include <cstdio>\n"
        "int main() { setup(); for (int k = 0; k < 500; ++k) loop();\n"
        '  std::printf("%d %d", estimate.finger[0].state, stub_led); }\n'
    )
    program = built(tmp_path, "builtin:noise-floor", "anyskin", "1", main, "c++", "-std=c++17",
                    single=True)  # fmt: skip
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    assert done.stdout == "1 0"  # NO_CONTACT


def test_the_header_runs_beside_python(capsys):
    runpy.run_path(str(FOLDER / "beside_python.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert "1725 samples: 0 states differ" in printed
    assert float(printed.split()[-1]) < 1e-9
