"""Write a submission to the benchmark: what a model of holdfast says at every sample.

    holdfast study data benchmark/
    python benchmarks/submission.py benchmark/ builtin:any any.parquet
    holdfast study score any.parquet --benchmark benchmark/

Another program writes the same columns, as .csv or .parquet (docs/benchmark.md). A split whose
sensors the model does not fit is left out.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast import Model, Recording, detect, load_dataset
from holdfast.contact import NO_CONTACT
from holdfast.errors import ModelError

SPLITS = ("tuning", "new-objects", "new-hand-and-objects", "slips", "knocks", "aged-skins")
SCHEMA = pa.schema(
    [
        ("recording", pa.string()),
        ("finger", pa.string()),
        ("sample", pa.int64()),
        ("stable", pa.float64()),
        ("slip", pa.float64()),
    ]
)


def scores_of(model: Model, split: str, recording: Recording) -> Iterator[pa.Table]:
    """Yield the rows of each finger; its latest estimate counts at each sample."""
    for finger, trace in detect(model, recording).fingers.items():
        times = recording.modules[finger].times
        latest = np.searchsorted(trace.times, times, side="right") - 1
        stable = np.where(trace.state == NO_CONTACT, 0.0, trace.stable_probability)
        slip = np.zeros(len(stable)) if trace.slip_probability is None else trace.slip_probability
        columns = [
            [f"{split}/{recording.name}"] * len(times),
            [finger] * len(times),
            np.arange(len(times)),
            *(
                np.where(latest < 0, 0.0, np.nan_to_num(scores)[latest])
                for scores in (stable, slip)
            ),
        ]
        yield pa.table(columns, schema=SCHEMA)


def main(folder: Path, name: str, out: Path) -> None:
    """Write the scores of a model for all splits that it fits."""
    model = Model.load(name)
    with pq.ParquetWriter(out, SCHEMA, compression="zstd") as writer:
        # A folder of version 1 has not all of them.
        for split in filter(lambda name: (folder / name).is_dir(), SPLITS):
            try:
                for recording in load_dataset(folder / split):
                    for table in scores_of(model, split, recording):
                        writer.write_table(table)
            except ModelError as cause:
                print(f"{split} is left out: {cause}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
