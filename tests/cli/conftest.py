import math

import pytest

from holdfast.cli.terminal import progress


@pytest.fixture(autouse=True)
def terminal_width(monkeypatch):
    """Make tables and paragraphs 80 columns wide on every machine."""
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture(autouse=True)
def no_progress_messages(monkeypatch):
    """Print no line of progress on stderr, even where a machine takes minutes."""
    monkeypatch.setattr(progress, "PROGRESS_INTERVAL", math.inf)


@pytest.fixture(scope="session")
def grasps(tmp_path_factory):
    """A folder with a model that is trained on recordings in `seen`, and others in `new`."""
    from holdfast.io import load_dataset, save_recording
    from holdfast.synthetic import synthetic_recording
    from holdfast.training import Setting, train

    root = tmp_path_factory.mktemp("grasps")
    for folder, seeds in (("seen", (0, 1)), ("new", (2, 3))):
        (root / folder).mkdir()
        for seed in seeds:
            recording = synthetic_recording(f"grasp-{seed}", seed, ("thumb", "index"))
            save_recording(recording, root / folder / f"grasp-{seed}.parquet")
    train(load_dataset(root / "seen"), Setting(trials=0)).model.save(root / "model.json")
    return root
