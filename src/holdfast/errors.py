"""Exceptions of the package: one class for each different reaction of a caller.

    HoldfastError
    ├── RecordingError   a recording or dataset cannot be read, or contradicts itself
    ├── ModelError       a model file is invalid, or does not fit the data
    ├── TrainingError    the data cannot train or test a classifier (one class, one group)
    ├── StreamError      a detector cannot process the samples
    ├── SourceError      a source cannot be reached, sends nothing, or is not the expected one
    ├── EngineError      the processes or the cluster that make parallel calls fail
    ├── OutputError      an output exists already or cannot be written
    └── MissingExtra     an optional package is not installed

Wrong arguments raise ``ValueError`` or ``TypeError``, as everywhere in Python. Every message
says what was given, what was expected and what exists. The command line prints it as one
line and exits with 2.
"""

import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

from holdfast.removed import removal

if TYPE_CHECKING:
    from collections.abc import Iterator
    from importlib.metadata import Distribution

EXTRA_MODULES = {
    "parquet": ("pyarrow",),
    "pandas": ("pandas",),
    "train": ("sklearn", "scipy", "joblib", "threadpoolctl"),
    "twin": ("mujoco", "scipy", "PIL", "joblib"),
    "plot": ("matplotlib",),
    "label": ("scipy",),
    "video": ("cv2", "scipy"),
    "cluster": ("dask", "distributed", "threadpoolctl"),
    "serial": ("serial",),
    "hdf5": ("h5py",),
}
"""Modules that each extra of `pyproject.toml` installs and that holdfast imports."""
EXTRA_PURPOSES = {
    "all": "all of the others",
    "parquet": "recordings as Parquet files",
    "pandas": "estimates and features as a DataFrame",
    "train": "holdfast train, evaluate and tune",
    "twin": "holdfast simulate and the source twin:",
    "plot": "figures, --plot",
    "label": "holdfast label",
    "video": "holdfast label markers, record --camera, and stickers in videos",
    "cluster": "a Dask cluster, --engine dask:ADDRESS",
    "ros": "topics of ROS without a ROS 2 installation, and bags",
    "serial": "sensors on a serial port",
    "hdf5": "import of HDF5 recordings",
    "grip": "holdfast hold: control of the grip force of a hand",
    "interop": "LeRobot, Rerun and public data sets",
}
"""Purpose of each extra, also of those that install packages beside the core."""

DISTRIBUTION = "holdfast-tactile"
"""Name of this distribution on the package index, which has another project called holdfast."""
LABORATORY = "holdfast-lab"
PACKAGE_PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "holdfast-grip": {
        "verbs": ("hold",),
    },
    "holdfast-ros": {
        "sources": ("ros2",),
        "importers": ("rosbag",),
        "publishers": ("ros2",),
        "hands": ("ros2",),
        "options": ("serve --ros2",),
    },
    LABORATORY: {
        "verbs": ("study", "trial"),
        "simulators": ("randomized",),
        "options": ("simulate --randomize", "simulate --grasps", "simulate --measured"),
    },
    "holdfast-interop": {
        "verbs": ("datasets",),
        "importers": ("eflesh", "gtac", "lerobot", "uskin-pick-move"),
        "exporters": ("lerobot", "rerun"),
        "publishers": ("rerun",),
        "options": ("export --fps", "export --model", "serve --rerun"),
    },
}
"""Entry points of the packages beside the core, by distribution and kind, and the `options` that
they add to verbs: so that what is not installed is a line with the command. A test compares it
with the packages. The extra of holdfast that installs a distribution has its name, without
`holdfast-`; the laboratory has none."""


class HoldfastError(Exception):
    """Base class of all exceptions of holdfast; the text is one line."""


class RecordingError(HoldfastError):
    """A recording cannot be read, is damaged, or is inconsistent: use another file."""


class ModelError(HoldfastError):
    """A model is invalid, or does not fit the data: use another model or sensor."""


class TrainingError(HoldfastError):
    """The data cannot train or test a classifier: use more or other recordings."""


class StreamError(HoldfastError):
    """A detector cannot process the samples: repair the source, then reset the detector."""


class SourceError(HoldfastError):
    """A source cannot be reached, or sends nothing or other data: repair it, then try again."""


class EngineError(HoldfastError):
    """The processes or the cluster of parallel calls fail: repair them, then start again."""


class OutputError(HoldfastError):
    """An output exists already or cannot be written; no incomplete file is left."""


class MissingExtra(HoldfastError):  # noqa: N818 (it names what to install, not what broke)
    """An optional package is not installed: install the extra that the text names.

    Args:
        package: name of the package or module.
        extra: the extra, or several with commas between them.
    """

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(package, extra)

    def __str__(self) -> str:
        package, extra = self.args
        return f"this needs the package {package}, which is not installed: {install_command(extra)}"


def is_installed(module: str) -> bool:
    """Return whether a module can be imported; it is not imported."""
    try:
        return sys.modules.get(module) is not None or find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def require_extras(*extras: str) -> None:
    """Check that the packages of some extras are installed; none of them is imported.

    Raises:
        MissingExtra: one is not. The text names all extras that are missing.
    """
    modules = {
        extra: [module for module in EXTRA_MODULES[extra] if not is_installed(module)]
        for extra in extras
    }
    missing = [extra for extra in extras if modules[extra]]
    if missing:
        raise MissingExtra(modules[missing[0]][0], ",".join(missing))


def missing_extra(cause: ModuleNotFoundError) -> MissingExtra | None:
    """Return the error of a failed import of an optional package; None for any other module."""
    module = (cause.name or "").partition(".")[0]
    extras = [extra for extra, modules in EXTRA_MODULES.items() if module in modules]
    package = module.replace("_", "-")  # one beside the core, which another one imports
    if package in PACKAGE_PARTS and package != LABORATORY:
        extras.append(package.removeprefix("holdfast-"))
    return MissingExtra(module, extras[0]) if extras else None


def missing_part(kind: str, name: str, what: str) -> HoldfastError | None:
    """Return the error of a part that was removed, or that another package has; else None.

    Args:
        kind: of the plug-in: `verbs`, `sources`, ..., or `options`.
        name: of the plug-in.
        what: what the name stands for, as in "the verb hold".
    """
    if text := removal(kind, name, what):
        return HoldfastError(text)
    for distribution, parts in PACKAGE_PARTS.items():
        if name in parts.get(kind, ()):
            return HoldfastError(
                f"{what} is part of {distribution}, which is not installed: "
                f"{_package_command(distribution)}"
            )
    return None


def other_version(distribution: str, version: str) -> str:
    """Return why a package beside the core does not fit it; empty if it fits, or is no such."""
    from importlib.metadata import version as version_of

    if distribution not in PACKAGE_PARTS or version == (core := version_of(DISTRIBUTION)):
        return ""
    return (
        f"{distribution} {version} given, {core} expected as of holdfast itself: "
        f"{_package_command(distribution)}"
    )


def _package_command(distribution: str) -> str:
    """Return the command that installs a package beside the core."""
    if distribution == LABORATORY:
        return "clone the repository of holdfast, and run `uv run holdfast` there"
    return install_command(distribution.removeprefix("holdfast-"))


def install_command(extra: str) -> str:
    """Return the command that adds an extra, or several, to the environment that runs.

    A project of uv gets it by uv itself, which keeps it; any other environment by `pip_command`. A
    clone is installed from its folder and a wheel from its file: the index may have neither.
    """
    import json
    from pathlib import Path
    from urllib.parse import unquote

    installed = next(installed_distributions(DISTRIBUTION), None)
    origin = json.loads((installed and installed.read_text("direct_url.json")) or "{}")
    is_clone = origin.get("dir_info", {}).get("editable")
    folder = Path(unquote(origin["url"].removeprefix("file://"))) if is_clone else None
    project, command = Path(sys.prefix).parent, pip_command("install")
    if command.startswith("uv ") and (project / "uv.lock").exists():
        verb = "sync --inexact" if folder == project else f"add {DISTRIBUTION}"
        where = "" if Path.cwd().is_relative_to(project) else f' --project "{project}"'
        return f"uv {verb}{where}" + "".join(f" --extra {name}" for name in extra.split(","))
    if folder:
        beside = folder / "packages" / f"holdfast-{extra}"
        return f'{command} -e "{beside if beside.is_dir() else f"{folder}[{extra}]"}"'
    return f'{command} "{DISTRIBUTION}[{extra}]{" @ " * bool(origin)}{origin.get("url", "")}"'


def pip_command(verb: str) -> str:
    """Return the command of uv or pip, whichever installed holdfast, for the environment that runs.

    The environment is named where the shell would choose another one.
    """
    import os
    import shutil
    from pathlib import Path

    installed = next(installed_distributions(DISTRIBUTION), None)
    if installed and (installed.read_text("INSTALLER") or "").strip() == "uv":
        is_active = os.environ.get("VIRTUAL_ENV") == sys.prefix
        return f"uv pip {verb}" + ("" if is_active else f' --python "{sys.prefix}"')
    is_active = Path(shutil.which("pip") or "").parent == Path(sys.executable).parent
    return f"pip {verb}" if is_active else f'"{sys.executable}" -m pip {verb}'


def installed_distributions(name: str) -> "Iterator[Distribution]":
    """Return the distributions of a name that an installer made.

    setuptools leaves metadata in `src` as well, which no installer has made.
    """
    from importlib.metadata import distributions

    return (x for x in distributions(name=name) if x.read_text("INSTALLER"))


def other_project() -> str:
    """Return a line about the project called holdfast, if it is installed too; else empty."""
    return "".join(
        f"the distribution holdfast {other.version} ({other.metadata['Summary']}) is installed "
        f"beside {DISTRIBUTION}; it may have replaced files of it: "
        f"{pip_command('uninstall')} holdfast, then install {DISTRIBUTION} again"
        for other in installed_distributions("holdfast")
    )


def package_versions() -> dict[str, dict[str, str | None]]:
    """Return the version of each required package, by extra ("" without one); None if missing."""
    import re
    from importlib.metadata import PackageNotFoundError, requires, version

    requirement = re.compile(r"(?P<package>[\w.-]+)(?:.*extra\s*==\s*['\"](?P<extra>[\w-]+)['\"])?")
    versions: dict[str, dict[str, str | None]] = {}
    for match in filter(None, map(requirement.match, requires(DISTRIBUTION) or [])):
        if match["package"] != DISTRIBUTION:
            group = versions.setdefault(match["extra"] or "", {})
            try:
                group[match["package"]] = version(match["package"])
            except PackageNotFoundError:
                group[match["package"]] = None
    # "all" requires other extras of this package, not packages
    others = (versions.get(extra, {}) for extra in EXTRA_PURPOSES if extra != "all")
    return versions | {"all": {name: text for group in others for name, text in group.items()}}


def listen_error(host: str, port: int, cause: Exception) -> OutputError:
    """Return the error of a server whose address is in use or cannot be bound."""
    text = getattr(cause, "strerror", None) or str(cause)
    reason = "it is in use" if "in use" in text else text
    return OutputError(f"cannot listen at {host}:{port} ({reason}); --port 0 finds a free port")
