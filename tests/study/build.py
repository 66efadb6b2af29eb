"""Small corpora for the tests of the study."""

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording


def written(folder, recordings):
    folder.mkdir(exist_ok=True)
    for recording in recordings:
        save_recording(recording, folder / f"{recording.name}.parquet")
    return folder


def synthetic(folder, seeds, fingers=("thumb", "index")):
    """Recordings of three objects by turns, one for each seed."""
    return written(folder, [synthetic_recording(f"grasp-{s}", s, fingers) for s in seeds])
