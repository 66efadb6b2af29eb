"""Child processes of Python that import no modules from the working folder.

`python -c` and `python -m` search the working folder first. So a file `bisect.py` beside the
recordings would run in every child process that imports bisect.
"""

import os
import sys
from threading import Lock

SAFE_PATH_VARIABLE = "PYTHONSAFEPATH"
"""Environment variable that keeps the working folder from the path of Python, as `python -P`."""


def python_command(program: str, *arguments: str) -> list[str]:
    """Return the command of a child process that finds the same modules as this one.

    Args:
        program: program of the child, as of `python -c`.
        arguments: its `sys.argv[1:]`.

    Example:
        >>> python_command("print(1)", "can")[1:3]
        ['-P', '-c']
    """
    # `-P` leaves out the working folder; the path of this process may have been changed since.
    path = [folder for folder in sys.path if isinstance(folder, str)]
    with_path = f"import sys; sys.path[:] = {path!r}; {program}"
    return [sys.executable, "-P", "-c", with_path, *arguments]


class _SafePath:
    """Context in which libraries start Python without the working folder on its path.

    They pass their environment on, so the variable is set in this process meanwhile. Several
    threads may enter; the last one to leave restores the environment.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._n_entered = 0
        self._before: str | None = None

    def __enter__(self) -> None:
        with self._lock:
            # Only the first one: for the others the value is already ours.
            if not self._n_entered:
                self._before = os.environ.get(SAFE_PATH_VARIABLE)
                os.environ[SAFE_PATH_VARIABLE] = "1"
            self._n_entered += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._n_entered -= 1
            if self._n_entered:
                return
            if self._before is None:
                os.environ.pop(SAFE_PATH_VARIABLE, None)
            else:
                os.environ[SAFE_PATH_VARIABLE] = self._before


safe_path = _SafePath()
"""The context of this process."""
