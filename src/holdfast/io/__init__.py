"""Files of recordings (Parquet, MCAP) and of labels, datasets, and import of other formats."""

from holdfast.io.dataset import Dataset, load_dataset
from holdfast.io.file_formats import load_recording, read_chunks, save_recording
from holdfast.io.importers import FORMATS, import_recordings
from holdfast.io.label_files import (
    LabelFile,
    labels_from_csv,
    labels_path,
    labels_to_csv,
    load_labels,
    save_labels,
)

__all__ = [
    "FORMATS",
    "Dataset",
    "LabelFile",
    "import_recordings",
    "labels_from_csv",
    "labels_path",
    "labels_to_csv",
    "load_dataset",
    "load_labels",
    "load_recording",
    "read_chunks",
    "save_labels",
    "save_recording",
]
