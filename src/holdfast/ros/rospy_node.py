"""This process as a node of ROS 1, by the rospy of a ROS or of Debian.

rospy is not on PyPI. It is imported as it is where the interpreter has it; else from where ROS
and Debian put it, behind everything else, if it is of this Python's version.
"""

import atexit
import logging
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.client import Error, ServerProxy, Transport

from holdfast.errors import SourceError

MASTER = "http://localhost:11311"
"""Where a master is if nobody says otherwise, as in ROS."""
ANSWER_TIME = 2.0
"""How long a master may take to answer [s]."""
PLACES = ("/opt/ros/*/lib/python3/dist-packages", "/usr/lib/python3/dist-packages")
"""Where ROS and Debian put rospy."""

_CALLER = "/holdfast"
_lock = threading.Lock()
_master: str | None = None


def rospy_module() -> ModuleType:
    """The module rospy.

    Raises:
        SourceError: there is none, or none for this Python.
    """
    with suppress(ImportError):
        return import_module("rospy")
    for place in _places():
        sys.path.append(place)
        try:
            return import_module("rospy")
        except ImportError:
            sys.path.remove(place)
            for name in [name for name in sys.modules if name.split(".")[0] == "rospy"]:
                del sys.modules[name]
    raise SourceError(
        "this needs rospy of ROS 1, which pip cannot install: apt install python3-rospy, and "
        f"a Python of the same version (this is {sys.version_info[0]}.{sys.version_info[1]})"
    )


def start_node(master: str) -> ModuleType:
    """rospy, with this process as a node of that master.

    Raises:
        SourceError: there is no rospy, the master does not answer, or the process is a node
            of another master already.
    """
    global _master  # noqa: PLW0603 (so is rospy: a process is one node, for ever)
    check_master(master)
    with _lock:
        rospy = rospy_module()
        if rospy.core.is_initialized():
            if _master not in (None, master):
                raise SourceError(f"this process is a node of {_master} and cannot be of {master}")
            return rospy
        os.environ["ROS_MASTER_URI"] = master
        rospy.init_node("holdfast", argv=["holdfast"], anonymous=True, disable_signals=True)
        atexit.register(rospy.signal_shutdown, "the process ends")
        _silence()
        _master = master
        return rospy


def master_uri(given: str | None) -> str:
    """The master that is asked for; else that of `ROS_MASTER_URI`, else the one of this machine.

    Raises:
        ValueError: it is no URI of one.
    """
    text = given if given is not None else os.environ.get("ROS_MASTER_URI", "").strip() or MASTER
    with suppress(ValueError):
        parts = urlsplit(text)
        if parts.scheme == "http" and parts.hostname and parts.port:
            return text.rstrip("/")
    raise ValueError(f"a master as {MASTER} expected, {text!r} given")


def check_master(master: str) -> None:
    """Returns where a master answers.

    Raises:
        SourceError: nothing does, within 2 s.
    """
    call_master(master, "getPid")


def published_topics(master: str) -> dict[str, str]:
    """Types of the topics that somebody publishes, by name.

    Raises:
        SourceError: the master does not answer.
    """
    names = {name for name, nodes in call_master(master, "getSystemState")[0] if nodes}
    return {name: kind for name, kind in call_master(master, "getTopicTypes") if name in names}


def call_master(master: str, what: str, *given: str) -> Any:  # noqa: ANN401 (whatever it answers)
    """What a master answers to a call of its interface.

    Raises:
        SourceError: nothing that is a master answers in time.
    """
    try:
        with ServerProxy(master, transport=_Impatient()) as proxy:
            code, text, value = getattr(proxy, what)(_CALLER, *given)
    except OSError as cause:
        raise SourceError(
            f"no ROS master answers at {master} ({cause.strerror or cause}): is roscore running? "
            "ROS_MASTER_URI or ?master= tell where"
        ) from cause
    except (Error, HTTPException, ValueError, TypeError) as cause:
        raise SourceError(f"what answers at {master} is no ROS master: {cause}") from cause
    if code != 1:
        raise SourceError(f"the ROS master at {master} refuses {what}: {text}")
    return value


class _Impatient(Transport):
    """A connection that does not wait for ever."""

    def make_connection(self, host: Any) -> HTTPConnection:  # noqa: ANN401
        connection = super().make_connection(host)
        connection.timeout = ANSWER_TIME
        return connection


def _places() -> Iterator[str]:
    """Folders with a rospy for this Python."""
    for pattern in PLACES:
        for folder in sorted(Path("/").glob(pattern.removeprefix("/"))):
            if (folder / "rospy").is_dir() and _fits(_pythons()):
                yield str(folder)


def _pythons() -> Sequence[str]:
    """Names of the machine's own Pythons, for which those folders are."""
    return [path.name for path in Path("/usr/bin").glob("python3.*")]


def _fits(names: Sequence[str]) -> bool:
    return f"python{sys.version_info[0]}.{sys.version_info[1]}" in names


def _silence() -> None:
    """Keeps rospy's log off the screen: stdout is for results. Its log file stays."""
    logger = logging.getLogger("rosout")
    for handler in logger.handlers[:]:
        if type(handler).__name__ == "RosStreamHandler":
            logger.removeHandler(handler)
