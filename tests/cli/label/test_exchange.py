from dataclasses import replace

from holdfast.io import labels_path, load_recording, save_recording

from .helpers import refusal, run_json, save_manual_labels


def test_labels_go_to_csv_and_back(capsys, folder):
    out = folder.parent / "csv"
    run_json(capsys, "export", "csv", out, folder)
    assert sorted(path.name for path in out.iterdir()) == ["one.labels.csv", "two.labels.csv"]
    run_json(capsys, "import", out / "one.labels.csv", folder / "one.parquet", "--dry-run")
    assert not labels_path(folder / "one.parquet").exists()
    run_json(capsys, "import", out, folder)
    inside = load_recording(folder / "two.mcap", labels=False).modules["index"].labels
    labels = load_recording(folder / "two.mcap").modules["index"].labels
    assert [(x.start, x.end, x.state) for x in labels] == [
        (x.start, x.end, x.state) for x in inside
    ]
    save_manual_labels(folder / "two.mcap")
    assert "(and 1 more)" in refusal(capsys, "import", out, folder, "--author", "bob")


def test_a_recording_whose_name_is_a_path_is_exported_into_the_folder(capsys, folder):
    path = folder / "one.parquet"
    for name in ("../../up", str(folder.parent / "abs")):
        save_recording(replace(load_recording(path), name=name), path, force=True)
        before = sorted(folder.parent.iterdir())
        run_json(capsys, "export", "csv", folder / "out", path)
        run_json(capsys, "import", folder / "out", path, "--dry-run")
        assert sorted(folder.parent.iterdir()) == before
    assert len(list((folder / "out").iterdir())) == 2
