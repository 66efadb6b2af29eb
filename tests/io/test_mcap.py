import random
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory

from holdfast.errors import RecordingError
from holdfast.io import load_recording, save_recording
from holdfast.recordings import Truth

SAMPLE_TOPICS = ("/tactile/thumb", "/tactile/index/1")


@pytest.fixture
def saved(make_recording, tmp_path):
    """A recording, the path of its file, and the bytes in it."""
    recording, path = make_recording(), tmp_path / "a.mcap"
    save_recording(recording, path)
    return recording, path, path.read_bytes()


@settings(max_examples=60)
@given(data=st.data())
def test_what_is_written_is_read(data, recordings, assert_same, tmp_path_factory):
    recording = data.draw(recordings)
    path = tmp_path_factory.mktemp("round") / "trip.mcap"
    save_recording(recording, path)
    assert_same(load_recording(path), recording)


def test_a_whole_recording(saved, assert_same):
    recording, path, _ = saved
    assert_same(load_recording(path), recording)
    assert load_recording(path).complete


def test_others_decode_it(saved):
    recording, path, _ = saved
    found = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(message)
    for topic, module in zip(SAMPLE_TOPICS, recording.modules.values(), strict=True):
        values = np.concatenate([np.asarray(message.values) for message in found[topic]])
        times = np.concatenate([np.asarray(message.times) for message in found[topic]])
        assert list(found[topic][0].shape) == [module.sensor.n_taxels, 3]
        np.testing.assert_array_equal(times, module.times)
        np.testing.assert_array_equal(values.reshape(module.readings.shape), module.readings)
    phases = [text for message in found["/truth/hand/phase"] for text in message.values]
    assert phases == recording.truth.hand["phase"].tolist()
    slides = [flag for m in found["/truth/finger/thumb/slides"] for flag in m.values]
    assert slides == recording.truth.fingers["thumb"]["slides"].tolist()
    assert [(m.time, m.text) for m in found["/holdfast/markers"]] == list(recording.markers)


def test_any_flipped_bit_is_found(make_recording, flipped, tmp_path):
    path, damaged = tmp_path / "a.mcap", tmp_path / "b.mcap"
    save_recording(make_recording(150), path)
    for offset, raw in flipped(path.read_bytes(), 400):
        damaged.write_bytes(raw)
        with pytest.raises(RecordingError):
            load_recording(damaged)
            pytest.fail(f"bit at byte {offset} not found")


def assert_prefix(got, want):
    """Every module, label and truth array is the beginning of the whole one's."""
    assert not got.complete
    for name, module in got.modules.items():
        n = module.n_samples
        np.testing.assert_array_equal(module.times, want.modules[name].times[:n])
        np.testing.assert_array_equal(module.readings, want.modules[name].readings[:n])
        np.testing.assert_array_equal(module.label_states, want.modules[name].label_states[:n])
    n = len(got.truth.times)
    for name, array in got.truth.hand.items():
        np.testing.assert_array_equal(array, want.truth.hand[name][:n])


def test_a_file_cut_anywhere_gives_the_rest(make_recording, tmp_path):
    recording = make_recording(450)
    path, cut = tmp_path / "a.mcap", tmp_path / "b.mcap"
    save_recording(recording, path)
    raw = path.read_bytes()
    chance = random.Random(0)
    sizes = sorted({*(chance.randrange(len(raw)) for _ in range(150)), len(raw) - 1, len(raw) - 9})
    n_before = 0
    for size in sizes:
        cut.write_bytes(raw[:size])
        try:
            part = load_recording(cut)
        except RecordingError as refusal:
            assert n_before == 0, refusal
            continue
        assert_prefix(part, recording)
        assert part.modules["thumb"].n_samples >= n_before
        n_before = part.modules["thumb"].n_samples
    assert n_before == recording.modules["thumb"].n_samples


def test_a_cut_and_damaged_file_gives_a_sound_prefix_or_nothing(make_recording, flipped, tmp_path):
    recording = make_recording(450)
    path = tmp_path / "a.mcap"
    save_recording(recording, path)
    raw = path.read_bytes()
    n_sound = 0
    for _, damaged in flipped(raw[: len(raw) * 2 // 3], 200, seed=1):
        path.write_bytes(damaged)
        try:
            part = load_recording(path)
        except RecordingError:
            continue
        assert_prefix(part, recording)
        n_sound += 1
    assert 0 < n_sound < 200


def test_a_cut_before_the_first_samples_is_refused(saved):
    _, path, raw = saved
    for size, text in ((0, "empty"), (4, "no MCAP"), (60, "no header"), (2000, "no samples")):
        path.write_bytes(raw[:size])
        with pytest.raises(RecordingError, match=f"{path} .*{text}"):
            load_recording(path)


def test_a_chunk_lost_from_the_middle_is_damage(saved):
    _, path, raw = saved
    with path.open("rb") as file:
        chunks = [r for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)]
    lost = raw.index(chunks[5].data)
    opcode = raw.rindex(b"\x06" + (len(chunks[5].data) + 44).to_bytes(8, "little"), 0, lost)
    end = opcode + 9 + len(chunks[5].data) + 44
    path.write_bytes(raw[:opcode] + raw[end : len(raw) * 2 // 3])
    with pytest.raises(RecordingError, match=r"message \d+ is missing"):
        load_recording(path)


def chunk_offsets(raw):
    """Return the offset of each chunk after the first, which holds the header."""
    offsets, offset = [], 8
    while raw[offset] != 15:
        offsets += [offset] if raw[offset] == 6 else []
        offset += 9 + int.from_bytes(raw[offset + 1 : offset + 9], "little")
    return offsets[1:]


@pytest.mark.parametrize("inside", [1, 41], ids=["length of the record", "length of its data"])
def test_a_damaged_length_in_a_cut_file_is_no_cut(saved, inside):
    _, path, raw = saved
    offset = chunk_offsets(raw)[3]
    for bit in range(64):
        damaged = bytearray(raw[: len(raw) * 2 // 3])
        damaged[offset + inside + bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(RecordingError, match=r"(record|chunk) at byte"):
            load_recording(path)


def test_zeros_in_place_of_the_last_chunks_are_a_cut(saved):
    """After a failure of the power a file has its new size, but zeros in place of the data."""
    recording, path, raw = saved
    offset = chunk_offsets(raw)[3]
    for end in (offset, offset + 5, offset + 60, offset + 1000):
        path.write_bytes(raw[:end] + bytes(20_000))
        part = load_recording(path)
        assert_prefix(part, recording)
        assert part.modules["thumb"].n_samples > 50


def test_files_of_others_are_refused(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_text("time,t01_x\n0,1\n")
    with pytest.raises(RecordingError, match="is no MCAP file"):
        load_recording(path)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(RecordingError, match="no recording of holdfast"):
        load_recording(path)


def test_truth_that_would_share_a_topic_is_refused(make_recording, tmp_path):
    zeros = np.zeros(1)
    truth = Truth(np.array([0.0]), {}, {"a": {"b/c": zeros}, "a/b": {"c": zeros}})
    with pytest.raises(RecordingError, match="two truth arrays"):
        save_recording(make_recording(truth=truth), tmp_path / "a.mcap")


def test_all_bytes_are_under_a_checksum(saved):
    """The checks rest on CRCs that the MCAP format itself has: others find damage too."""
    _, _, raw = saved
    assert raw.endswith(MCAP0_MAGIC)
    start = int.from_bytes(raw[-28:-20], "little")
    assert zlib.crc32(raw[: start - 13]) == int.from_bytes(raw[start - 4 : start], "little")
    assert zlib.crc32(raw[start:-12]) == int.from_bytes(raw[-12:-8], "little")
