"""Start holdfast with its ROS 2 topics, and the two nodes of this folder.

ros2 launch holdfast.launch.py
ros2 launch holdfast.launch.py model:=model.json source:=xela://auto unit:=count
"""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

FOLDER = Path(__file__).parent
ARGUMENTS = {
    "model": ("builtin:twin", "model file, or a built-in model"),
    "source": ("twin:?object=can", "recording, or URI of a source"),
    "port": ("8080", "port of the page"),
    "unit": ("count", "of the readings: count or N"),
}


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` starts."""
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    chosen = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    serve = ["holdfast", "serve", chosen["model"], chosen["source"], "--ros2"]
    serve += ["--port", chosen["port"]]
    watch = [sys.executable, str(FOLDER / "watch_states.py")]
    grip = [sys.executable, str(FOLDER / "grip_harder.py")]
    grip += ["--ros-args", "-p", ["unit:=", chosen["unit"]]]
    programs = [ExecuteProcess(cmd=command, output="screen") for command in (serve, watch, grip)]
    return LaunchDescription([*arguments, *programs])
