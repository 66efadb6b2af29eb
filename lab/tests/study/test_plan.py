from dataclasses import replace

import msgspec
import pytest

from holdfast.contact import ContactState
from holdfast.errors import RecordingError, TrainingError
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.plan import content_digest, scan_corpus

from .example_recordings import save_all, save_synthetic


def relabelled(recording, state):
    labels = {
        finger: [Label(m.times[0], m.times[-1], state)] for finger, m in recording.modules.items()
    }
    return recording.with_labels(labels)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return save_synthetic(tmp_path_factory.mktemp("corpus") / "main", range(3))


def test_the_digest_depends_on_everything_that_a_study_uses():
    one = synthetic_recording("one", 0, ["index"])
    index = one.modules["index"]
    others = [
        replace(one, name="two"),
        relabelled(one, ContactState.STABLE),
        replace(one, metadata={"object": "another"}),
        replace(one, modules={"index": replace(index, readings=index.readings + 1)}),
    ]
    digests = {content_digest(each) for each in (one, *others)}
    assert len(digests) == 5
    assert content_digest(synthetic_recording("one", 0, ["index"])) == content_digest(one)


@pytest.mark.parametrize(
    ("states", "message"),
    [
        ((None, None), "none of the 2 recordings has labels"),
        ((ContactState.STABLE, ContactState.STABLE), "a finger with both is needed"),
        (("as made",), "one recording with labels given"),
        (("as made", None), "one recording with labels given"),
    ],
)
def test_labels_that_nothing_can_be_trained_from(tmp_path, states, message):
    recordings = []
    for seed, state in enumerate(states):
        made = synthetic_recording(f"grasp-{seed}", seed, ["index"])
        if state is None:
            made = made.with_labels({})
        elif state != "as made":
            made = relabelled(made, state)
        recordings.append(made)
    with pytest.raises(TrainingError, match=message):
        scan_corpus("main", save_all(tmp_path / "data", recordings))


def test_a_missing_folder_or_recording_is_named(tmp_path):
    folder = save_synthetic(tmp_path / "data", range(3))
    corpus = scan_corpus("main", folder)
    (folder / "grasp-1.parquet").unlink()
    with pytest.raises(RecordingError, match="grasp-1"):
        corpus.load()
    gone = msgspec.structs.replace(corpus, folder=str(tmp_path / "gone"))
    with pytest.raises(RecordingError, match="gone"):
        gone.load()
