"""Labels of Label Studio: recordings and labels for it, and labels from its JSON export.

The plug-in `label-studio` of `holdfast label export` and `label import`.
"""

from collections.abc import Iterable
from pathlib import Path

from holdfast.errors import RecordingError
from holdfast.files import read_input
from holdfast.io.label_files import MAX_LABEL_FILE_SIZE
from holdfast.recordings import Recording
from holdfast_interop.label_studio.reading import is_label_studio
from holdfast_interop.label_studio.reading import labels_from_label_studio as read
from holdfast_interop.label_studio.writing import CONFIG, save_label_studio

__all__ = ["can_read", "read", "save"]


def can_read(path: Path) -> bool:
    """Return whether a file is JSON of Label Studio.

    Raises:
        RecordingError: it cannot be read.
    """
    if path.suffix != ".json":
        return False
    try:
        return is_label_studio(read_input(path, MAX_LABEL_FILE_SIZE))
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause


def save(recordings: Iterable[Recording], folder: Path, *, force: bool = False) -> list[Path]:
    """Write recordings and their labels; see `save_label_studio`.

    Returns:
        The paths of the tasks and of the labelling config.
    """
    tasks = save_label_studio(recordings, folder, force=force)
    return [tasks, tasks.with_name(CONFIG)]
