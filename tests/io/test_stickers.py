"""Stickers in videos that a test draws: poses, stamps, and files that are no video."""

from pathlib import Path

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import foreign, stickers
from holdfast.io.foreign import read_stickers
from holdfast.io.stickers import picture_stamps, sticker_poses
from traps import traps

cv2 = pytest.importorskip("cv2")

SIZE, SIDE, N = (320, 240), 48, 40


def middle(k, number):
    """Where the middle of a sticker is in picture k, from the middle of the picture [pixels]."""
    return np.array([-60.0 + 90 * number + 0.13 * k, 5.0 * np.sin(k / 7)])


def picture(k, numbers):
    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    grey = np.full((4 * SIZE[1], 4 * SIZE[0]), 120, np.uint8)
    for number in numbers:
        black = cv2.aruco.generateImageMarker(book, number, 4 * SIDE)
        ink = np.pad(black, 32, constant_values=230)
        x, y = 4 * (middle(k, number) + np.array(SIZE) / 2) - len(ink) / 2
        turn = np.array([[1.0, 0, x], [0, 1.0, y]])
        grey = cv2.warpAffine(
            ink, turn, grey.shape[::-1], grey, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT
        )
    return cv2.cvtColor(cv2.resize(grey, SIZE, interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2BGR)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A film of two stickers; number 1 is covered for some pictures."""
    path = tmp_path_factory.mktemp("film") / "run.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SIZE)
    for k in range(N):
        writer.write(picture(k, (0,) if 20 <= k < 24 else (0, 1)))
    writer.release()
    yield path
    foreign.end_children()


def test_places_are_exact_to_hundredths_of_a_pixel(film):
    times, levels, poses = read_stickers(film)
    assert levels == pytest.approx(np.full(N, levels[0]), rel=0.1)
    assert times == pytest.approx(np.arange(N) / 30)
    assert sorted(poses) == [0, 1]
    truth = np.array([middle(k, 0) for k in range(N)])
    away = poses[0][:, :, 2] - truth
    assert away.std(axis=0).max() < 0.07
    assert np.abs(away.mean(axis=0)).max() < 0.3
    assert poses[0][:, 0, 0] == pytest.approx(np.full(N, SIDE), rel=0.03)


def test_a_covered_sticker_is_not_seen_and_comes_back(film):
    _, _, poses = read_stickers(film)
    seen = np.isfinite(poses[1][:, 0, 0])
    assert seen[:20].all()
    assert not seen[21:24].any()
    assert seen[28:].all()


def test_the_rate_can_be_given(film):
    assert read_stickers(film, fps=10.0)[0] == pytest.approx(np.arange(N) / 10)


def test_parts_join_to_the_whole(film, monkeypatch):
    whole = read_stickers(film)
    monkeypatch.setattr(stickers, "PICTURES_PER_PART", 7)
    parts = list(sticker_poses(film))
    assert [len(times) for times, _, _ in parts] == [7, 7, 7, 7, 7, 5]
    assert np.concatenate([times for times, _, _ in parts]) == pytest.approx(whole[0])


@pytest.mark.parametrize("content", [b"", b"no video\n" * 99, b"\0\0\0\x18ftypmp42" + b"\xff" * 99])
def test_what_is_no_video_is_one_line(tmp_path, content):
    path = tmp_path / "run.mp4"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"run\.mp4 is no video"):
        read_stickers(path)


def test_a_damaged_film_ends(film, tmp_path):
    content = bytearray(film.read_bytes())
    content[2000:9000] = bytes(7000)
    path = tmp_path / "run.mp4"
    path.write_bytes(content)
    times, _, _ = read_stickers(path)
    assert len(times) <= N


def test_a_missing_film(tmp_path):
    with pytest.raises(RecordingError, match=r"run\.mp4 does not exist"):
        read_stickers(tmp_path / "run.mp4")


@traps
def test_no_stamps_are_read_but_of_a_file(tmp_path, word, trap):
    assert picture_stamps(tmp_path / "run.mp4") is None
    trap(tmp_path / "run.times")
    with pytest.raises(RecordingError, match=rf"run\.times: it is a {word}"):
        picture_stamps(tmp_path / "run.mp4")


@pytest.mark.parametrize("name", ["run.mp4", "concat:film.mp4"])
def test_a_text_that_names_a_video_is_none(film, tmp_path, monkeypatch, name):
    """FFmpeg would open the film that the text, or the name of the file, names."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film.mp4").write_bytes(film.read_bytes())
    text = "ffconcat version 1.0\nfile 'film.mp4'\n"
    for content in (text, "#EXTM3U\n#EXTINF:1,\nfilm.mp4\n", ""):
        (tmp_path / name).write_text(content)
        with pytest.raises(RecordingError, match=f"{name} is no video"):
            read_stickers(Path(name))
