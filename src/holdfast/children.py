"""Child processes of Python that import no modules from the working folder.

`python -c` and `python -m` search the working folder first. So a file `bisect.py` beside the
recordings would run in every child process that imports bisect.
"""

import sys


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
