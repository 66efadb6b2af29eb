from dataclasses import replace

import msgspec
import pytest

from holdfast.contact import ContactState
from holdfast.errors import RecordingError, TrainingError
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.plan import Corpus, StudyPlan, content_digest, scan_corpus

from .example_recordings import save_all, save_synthetic


def relabelled(recording, state):
    labels = {
        finger: [Label(m.times[0], m.times[-1], state)] for finger, m in recording.modules.items()
    }
    return recording.with_labels(labels)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return save_synthetic(tmp_path_factory.mktemp("corpus") / "main", range(3))


def test_a_corpus_describes_a_folder(folder):
    corpus = scan_corpus("main", folder, tare="0.4")
    assert corpus.name == "main"
    assert corpus.recordings == ("grasp-0", "grasp-1", "grasp-2")
    assert corpus.fingers == ("thumb", "index")
    assert corpus.rate == pytest.approx(150.0)
    assert corpus.tare == "0.4"


def test_a_corpus_loads_only_its_recordings(folder, tmp_path):
    corpus = scan_corpus("main", folder)
    save_synthetic(folder, [7])
    try:
        assert corpus.load().names == corpus.recordings
        assert corpus.load()[0].name == "grasp-0"
    finally:
        (folder / "grasp-7.parquet").unlink()


def test_a_corpus_can_be_sent_and_hashed(folder):
    corpus = scan_corpus("main", folder)
    back = msgspec.msgpack.decode(msgspec.msgpack.encode(corpus), type=Corpus)
    assert back == corpus
    assert hash(back) == hash(corpus)


def test_methods_are_trained_on_main(folder):
    corpus = scan_corpus("main", folder)
    assert StudyPlan({"main": corpus}).main is corpus


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


def test_a_finger_of_one_class_is_left_out(tmp_path):
    recordings = []
    for seed in range(2):
        one = synthetic_recording(f"grasp-{seed}", seed, ["thumb", "index"])
        lost = relabelled(one, ContactState.NO_CONTACT).modules["thumb"]
        recordings.append(replace(one, modules={**one.modules, "thumb": lost}))
    assert scan_corpus("main", save_all(tmp_path / "data", recordings)).fingers == ("index",)


def test_a_worker_without_the_folder_is_an_error(folder, tmp_path):
    corpus = msgspec.structs.replace(scan_corpus("main", folder), folder=str(tmp_path / "gone"))
    with pytest.raises(RecordingError) as error:
        corpus.load()
    assert str(error.value) == (
        f"the folder {tmp_path / 'gone'} with the recordings of 'main' does not exist here: "
        "every worker needs it at the same path"
    )


def test_a_deleted_recording_is_named(tmp_path):
    folder = save_synthetic(tmp_path / "data", range(3))
    corpus = scan_corpus("main", folder)
    (folder / "grasp-1.parquet").unlink()
    with pytest.raises(RecordingError) as error:
        corpus.load()
    assert str(error.value) == (
        f"1 of the 3 recordings of 'main' are no longer in {folder}: grasp-1"
    )


def test_no_labels(tmp_path):
    bare = [synthetic_recording(f"grasp-{s}", s, ["index"]).with_labels({}) for s in range(2)]
    with pytest.raises(TrainingError) as error:
        scan_corpus("main", save_all(tmp_path / "data", bare))
    assert str(error.value) == "none of the 2 recordings has labels to train from"


def test_one_class(tmp_path):
    recordings = [
        relabelled(synthetic_recording(f"grasp-{s}", s, ["index"]), ContactState.STABLE)
        for s in range(2)
    ]
    folder = save_all(tmp_path / "data", recordings)
    with pytest.raises(TrainingError) as error:
        scan_corpus("main", folder)
    assert str(error.value) == (
        f"{folder}: 3448 samples labelled stable and 0 labelled not stable given; "
        "a finger with both is needed"
    )


@pytest.mark.parametrize("n_bare", [0, 1])
def test_one_recording(tmp_path, n_bare):
    recordings = [synthetic_recording("grasp-0", 0, ["index"])]
    recordings += [synthetic_recording("bare", 1, ["index"]).with_labels({})] * n_bare
    folder = save_all(tmp_path / "data", recordings)
    with pytest.raises(TrainingError) as error:
        scan_corpus("main", folder)
    assert str(error.value) == (
        f"{folder}: one recording with labels given (grasp-0); at least two are needed, "
        "because test recordings must not be used for training"
    )


def test_an_unknown_tare(folder):
    with pytest.raises(ValueError, match="'sometimes' given"):
        scan_corpus("main", folder, tare="sometimes")
