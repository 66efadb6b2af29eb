"""`holdfast study data` and `holdfast study score`: the benchmark."""

from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.parallel import Engine
    from holdfast_lab.study.benchmark.protocol import BenchmarkSplit


def make_data(folder: Path, engine: "Engine", *, as_json: bool) -> None:
    """Simulate the missing recordings of the benchmark, and compare them with its digests.

    Raises:
        OutputError: existing recordings have another seed.
    """
    from holdfast_lab.study.benchmark.protocol import differing, digest_of, load_split, protocol

    version = protocol(folder)
    document: dict[str, object] = {"version": version.version}
    for name, split in version.splits.items():
        print_message(f"{name}: {split.holds}")
        simulate_split(folder / name, split, engine)
        recordings = load_split(folder, name)
        digests = {r.name: digest_of(r) for r in progress(recordings, "comparing")}
        differ = differing(split, digests)
        document[name] = {"recordings": digests, "differ": differ}
        if differ:
            print_message(
                f"{name}: {len(differ)} of {len(digests)} recordings differ from the protocol, "
                f"such as {differ[0]}: other versions of libraries, or another kind of processor"
            )
    if as_json:
        print_json(document)
    else:
        print_line(f"{folder}: the benchmark, version {version.version}")


def print_scores(path: Path, folder: Path, *, as_json: bool) -> None:
    """Score a submission and print the tables.

    Raises:
        ValueError: the submission is wrong or incomplete.
        RecordingError: the recordings of the benchmark do not exist.
    """
    from holdfast_lab.report.result_tables import to_json
    from holdfast_lab.report.terminal import print_score_table
    from holdfast_lab.study.benchmark.protocol import protocol
    from holdfast_lab.study.benchmark.scoring import score_submission
    from holdfast_lab.study.benchmark.submission import read_submission

    if not path.is_file():
        raise ValueError(f"{path}: no such file; a submission as .csv or .parquet expected")
    version = protocol(folder)
    result = score_submission(read_submission(path), folder, version)
    if result.differ:
        print_message(
            f"{len(result.differ)} recordings are not those of the protocol, such as "
            f"{result.differ[0]}: the figures are not comparable"
        )
    if result.left_out:
        print_message(f"no scores, and not scored: {', '.join(result.left_out)}")
    if as_json:
        tables = {table.name: to_json(table) for table in result.tables}
        print_json({
            "submission": path.name, "version": version.version, "differ": result.differ,
            "left_out": result.left_out, "tables": tables,
        })  # fmt: skip
        return
    for table in result.tables:
        print_score_table(table)


def simulate_split(folder: Path, split: "BenchmarkSplit", engine: "Engine") -> None:
    """Simulate the missing recordings of a part of the benchmark."""
    from holdfast.cli.simulate.options import GraspOptions
    from holdfast.twin.objects import OTHER_OBJECTS
    from holdfast.twin_recordings import plan_grasps, simulate_grasps
    from holdfast_lab.study.benchmark.protocol import MEASURED_ALL
    from holdfast_lab.verbs.randomized import HandOptions, RandomizedHands

    folder.mkdir(parents=True, exist_ok=True)
    if split.randomized:
        grasps = GraspOptions(repeats=split.repeats, seed=split.seed)
        hands = HandOptions(randomize=True, measured=MEASURED_ALL)
        RandomizedHands.simulate(folder, grasps, hands, engine=engine, force=False)
        return
    table = OTHER_OBJECTS if split.other_objects else None
    planned = plan_grasps(
        "", "1,2", split.repeats, split.profile, split.seed, table=table, faults=split.faults
    )
    simulate_grasps(
        planned, folder, engine=engine, force=False, notify=print_message, steps=progress
    )
