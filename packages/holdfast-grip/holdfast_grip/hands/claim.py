"""Claim on a hand, so that one process of a user controls it at a time."""

import hashlib
import os
from contextlib import ExitStack, suppress
from pathlib import Path

from holdfast.files import lock
from holdfast.openable import Openable
from holdfast_grip.errors import HandError

FOLDER = Path(".local", "state", "holdfast", "claims")
"""Folder of the claims, in the home of the user."""
FOLDER_OF_NO_HOME = "/tmp/holdfast-claims-{}"
"""Folder of the claims of a user without a home, by the number of the user."""
_FOLDER_MODE, _FILE_MODE, _FOREIGN_BITS = 0o700, 0o600, 0o077


class Claim(Openable):
    """Claim on a hand: a locked file in a folder that only this user can use.

    The claim of a process that died ends with it.

    Args:
        name: `HandDevice.resource` of the hand.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        # A hash, because the name of a resource has slashes and any length.
        self._file_name = f"{hashlib.sha256(os.fsencode(name)).hexdigest()[:32]}.lock"
        self._stack = ExitStack()

    def open(self) -> None:
        """Claim the hand.

        Raises:
            HandError: another process has claimed it, or the folder of the claims is not usable.
        """
        if os.name != "posix":
            return
        path = claims_folder()
        with ExitStack() as stack:
            try:
                folder = _open_folder(path)
                stack.callback(os.close, folder)
                stack.callback(os.close, _lock(folder, self._file_name))
                stack.callback(_remove, folder, self._file_name)  # while it is locked
            except BlockingIOError as cause:
                raise HandError(
                    f"{self._name} has another controller already: stop that one first"
                ) from cause
            except OSError as cause:
                raise HandError(
                    f"cannot claim {self._name} in {path}: {cause.strerror or cause}"
                ) from cause
            self._stack = stack.pop_all()

    def close(self) -> None:
        """Release the hand. It has no effect on one that is not claimed."""
        self._stack.close()


def claims_folder() -> Path:
    """Return the folder of the claims of this user.

    It depends on the user only: two shells of one user may have different variables HOME,
    TMPDIR and XDG_RUNTIME_DIR, and the folder of the last is deleted when the user logs out.
    """
    import pwd

    user = os.geteuid()
    with suppress(KeyError, OSError):  # a container may run as a user without an account
        home = Path(pwd.getpwuid(user).pw_dir)
        if home.is_dir() and home.stat().st_uid == user:
            return home / FOLDER
    return Path(FOLDER_OF_NO_HOME.format(user))


def _open_folder(path: Path) -> int:
    """Open the folder of the claims; create it if it is missing.

    Raises:
        OSError: it cannot be created, or it is not a folder that only this user can use.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        path.mkdir(_FOLDER_MODE)
    # Open first and check what is open: a path can be replaced in between.
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    status = os.fstat(folder)
    if status.st_uid == os.geteuid() and not status.st_mode & _FOREIGN_BITS:
        return folder
    os.close(folder)
    raise PermissionError(
        f"a folder of user {os.geteuid()} with mode 700 expected, one of user {status.st_uid} with "
        f"mode {status.st_mode & 0o777:o} found"
    )


def _lock(folder: int, name: str) -> int:
    """Open and lock a file of a folder.

    Raises:
        BlockingIOError: another process has locked it.
        OSError: it cannot be opened or locked, or is a symbolic link.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    while True:
        file = os.open(name, flags, _FILE_MODE, dir_fd=folder)
        try:
            lock(file)
            if _is_at(folder, name, file):
                return file
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # its owner removed it between the two calls


def _is_at(folder: int, name: str, file: int) -> bool:
    """Return whether an open file is still the one of that name."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(file), os.stat(name, dir_fd=folder, follow_symlinks=False))
    return False


def _remove(folder: int, name: str) -> None:
    with suppress(OSError):
        os.unlink(name, dir_fd=folder)
