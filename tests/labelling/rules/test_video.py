"""Slips in a video, from poses of stickers that a test makes: what moves, and what is felt."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import stickers
from holdfast.labelling.rules import propose, video, video_clock
from holdfast.labelling.rules.video import change_point
from holdfast.labelling.rules.video_motion import VideoRule
from holdfast.metrics.slip_truth import label_slips
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import sensor

RATE, FPS, SECONDS = 100.0, 60.0, 40.0
SLIPS = ((12.0, 1.5), (24.0, 0.8))
"""Onset [s] and distance [mm] of the slips of the index finger; each lasts 0.2 s."""
PIXELS = 2.5
"""Pixels in a millimetre of the object's sticker."""
SHIFT = 0.237
"""Time that is added to the clock of the video [s]."""


def forces(times, seed=0):
    """Return (n, 3): free, closing, held with loads that come and go, and free again."""
    generator = np.random.default_rng(seed)
    grip = np.interp(times, [2, 3, SECONDS - 3, SECONDS - 2], [0, 10.0, 10.0, 0])
    held = (times > 4) & (times < SECONDS - 4)
    load = np.zeros((len(times), 2))
    for start in np.arange(5, SECONDS - 5, 1.0) + generator.uniform(0, 0.3, int(SECONDS - 10)):
        shape = np.exp(-(((times - start - 0.3) / generator.uniform(0.05, 0.2)) ** 2))
        load += 4 * shape[:, None] * generator.normal(0, 1, 2)
    return np.column_stack([load * held[:, None], grip])


def recording(seed=0):
    patch = sensor("uskin-4x4")
    times = np.arange(0, SECONDS, 1 / RATE)
    modules = {}
    for k, finger in enumerate(("thumb", "index")):
        noise = np.random.default_rng([seed, k]).normal(0, 1, (len(times), 16, 3))
        readings = 100 * forces(times, seed)[:, None] / 16 + noise
        modules[finger] = Tactile(patch, times, np.round(readings).astype(np.int32))
    return Recording("pulls", modules, {})


def sticker_track(slips=SLIPS, tip_size=15.0, elastic=0.3, tip=2, fps=FPS):
    """Return times [s] and poses of the stickers of the object and of a fingertip."""
    times = np.arange(0, SECONDS - 1, 1 / fps)
    shown = times + SHIFT
    slid = sum(size * np.clip((shown - onset) / 0.2, 0, 1) for onset, size in slips)
    moved = elastic * forces(shown)[:, :2] + np.column_stack([slid, np.zeros(len(times))])
    generator = np.random.default_rng(5)
    found = {}
    for number, side, middle in (
        (0, 24.0, np.zeros((1, 2))),
        (tip, tip_size, moved + np.array([30.0, 5.0])),
    ):
        pose = np.zeros((len(times), 2, 3))
        pose[:, 0, 0] = pose[:, 1, 1] = side * PIXELS
        pose[:, :, 2] = middle * PIXELS
        found[number] = pose + generator.normal(0, 0.01, pose.shape)
    return times, found


@pytest.fixture
def film(monkeypatch):
    def shown(times, found, levels=None):
        levels = np.zeros(len(times)) if levels is None else levels
        monkeypatch.setattr(video, "read_stickers", lambda path, fps: (times, levels, found))

    return shown


def slips_of(labels):
    return [label for label in labels if label.cause == "slip"]


def offset_of(label):
    """Offset of the clocks in the evidence of a label [s]."""
    return float(label.evidence.split("later by ")[1].split()[0])


def check_onsets(labels, within, finger="index"):
    """Check that the slips of a finger begin where those of the film do."""
    found = slips_of(labels[finger])
    assert [label.start for label in found] == pytest.approx([s for s, _ in SLIPS], abs=within)
    return found


def test_slips_are_found_and_yielding_is_none(film):
    film(*sticker_track())
    labels = propose("tracking", recording(), video="run.mp4")
    assert slips_of(labels["thumb"]) == []  # no sticker of the thumb is in view
    found = check_onsets(labels, 0.02)
    for label, (onset, size) in zip(found, SLIPS, strict=True):
        assert label.end == pytest.approx(onset + 0.2, abs=0.06)
        distance = float(label.evidence.split()[1])
        assert distance == pytest.approx(size, abs=0.1)
        assert offset_of(label) == pytest.approx(SHIFT, abs=0.008)
        assert "video run.mp4" in label.evidence
        assert label.author == "rule:tracking"
        assert label.confidence > 0.5
    states = {(str(label.state), str(label.cause)) for label in labels["index"]}
    assert ("UNSTABLE", "closing") in states
    assert ("STABLE", "None") in states
    assert len(label_slips(labels["index"])) == len(SLIPS)


def test_irregular_stamps_and_short_gaps_are_no_hindrance(film):
    times, found = sticker_track()
    kept = np.random.default_rng(3).random(len(times)) > 0.1  # a tenth of the pictures is lost
    found[2][1200:1203] = np.nan
    film(times[kept], {number: pose[kept] for number, pose in found.items()})
    check_onsets(propose("tracking", recording(), video="run.mp4"), 0.03)


def test_an_offset_and_numbers_of_stickers_can_be_given(film):
    times, found = sticker_track(tip=7)
    film(times, found)
    labels = propose(
        "tracking", recording(), video="run.mp4", offset=SHIFT, bodies={"object": 0, "thumb": 7}
    )
    assert slips_of(labels["index"]) == []
    assert offset_of(slips_of(labels["thumb"])[0]) == SHIFT


def changed(change, **words):
    times, found = sticker_track(**words)
    return change(times, found) or (times, found)


def without(number):
    return changed(lambda _, found: found.pop(number) is None)


def hide(times, found):
    found[0][500:] = np.nan


def show_another_time(times, found):
    found[2][:, :, 2] = np.array([75.0, 12.0]) + 3 * forces(times, seed=9)[:, :2]


def lose_pictures(times, found):
    """Pictures that were dropped without a gap in the stamps."""
    kept = np.arange(len(times)) % 50 < 49
    return times[: kept.sum()], {number: pose[kept] for number, pose in found.items()}


NOT_ALIKE = "its (motion is not that of|clock is known to)"
BAD_FILMS = {
    "no sticker": (lambda: (sticker_track()[0], {}), "none"),
    "no object": (lambda: without(0), r"index \(2\) in 100%"),
    "no finger": (lambda: without(2), r"object \(0\) in 100%"),
    "hidden": (lambda: changed(hide), r"object \(0\) in 21%, index \(2\) in 100%"),
    "other size": (lambda: sticker_track(tip_size=30.0), r"sticker 2 \(index\) .*15 mm .*24 mm"),
    "other time": (lambda: changed(show_another_time), "its motion is not that of"),
    "nothing moves": (lambda: sticker_track(slips=((0, 0),), elastic=0), NOT_ALIKE),
    "lost pictures": (lambda: changed(lose_pictures), NOT_ALIKE),
}


@pytest.mark.parametrize(("made", "message"), BAD_FILMS.values(), ids=BAD_FILMS)
def test_a_film_that_shows_no_slips_is_refused(film, made, message):
    film(*made())
    with pytest.raises(RecordingError, match=rf"run\.mp4.*{message}"):
        propose("tracking", recording(), video="run.mp4")


@pytest.mark.parametrize("bodies", [{"object": 0}, {"index": 2}, {"object": 0, "toe": 3}])
def test_stickers_of_other_bodies_are_refused(film, bodies):
    film(*sticker_track())
    with pytest.raises(ValueError, match="thumb, index"):
        propose("tracking", recording(), video="run.mp4", bodies=bodies)


def test_the_size_of_a_sticker_is_above_zero():
    with pytest.raises(ValueError, match="tip_size"):
        VideoRule(tip_size=-1)


def test_a_change_point_is_before_the_noise_is_left():
    times, generator = np.arange(30) / FPS, np.random.default_rng(0)
    errors, spreads = [], []
    for _ in range(50):
        line = np.maximum(times - 0.3, 0) + generator.normal(0, 0.02, len(times))
        onset, spread = change_point(times, line, 0.02)
        errors.append(onset - 0.3)
        spreads.append(spread)
    assert abs(np.mean(errors)) < 0.02
    assert np.std(errors) == pytest.approx(np.mean(spreads), rel=0.6)


def stamped(tmp_path, film, lines):
    """A film of which a tenth of the pictures was lost, with no gap in the stamps of its file."""
    times, found = sticker_track()
    kept = np.random.default_rng(3).random(len(times)) > 0.1
    n = kept.sum()
    film(np.arange(n) / 1.0, {number: pose[kept] for number, pose in found.items()})
    # On the clock of the samples, as `record --camera` writes them.
    text = "".join(f"{time:.6f}\n" for time in times[kept] + SHIFT)
    (tmp_path / "run.times").write_text(text + lines)
    return tmp_path / "run.mp4"


def test_the_stamps_of_a_recorded_camera_count(film, tmp_path):
    labels = propose("tracking", recording(), video=stamped(tmp_path, film, "39.1"))
    assert offset_of(check_onsets(labels, 0.03)[0]) == pytest.approx(0, abs=0.008)


def test_the_stamps_give_the_clock_where_motion_does_not(film, tmp_path, monkeypatch):
    path = stamped(tmp_path, film, "")
    monkeypatch.setattr(video_clock, "CLEAR_PEAK", 1e9)
    found = slips_of(propose("tracking", recording(), video=path)["index"])
    assert offset_of(found[0]) == pytest.approx(0, abs=0.008)
    (tmp_path / "run.times").unlink()
    with pytest.raises(RecordingError, match="its motion"):
        propose("tracking", recording(), video=path)


@pytest.mark.parametrize("lines", ["no time\n", "3.0\n", "nan\n", "40.0\n" + 20_000 * " "])
def test_stamps_that_are_none(film, tmp_path, monkeypatch, lines):
    monkeypatch.setattr(stickers, "MAX_STAMPS", 40_000)
    with pytest.raises(RecordingError, match=r"run\.times"):
        propose("tracking", recording(), video=stamped(tmp_path, film, lines))


def measured(names, scale=1e-3):
    """Return lines of a CSV file of another instrument, which sees the same motion."""
    times, found = sticker_track()
    moved = (found[2][:, :, 2] - found[0][:, :, 2]) / PIXELS
    away = scale * (moved - moved[0])
    turned = moved[:, 0] - moved[0, 0]
    half = turned / 10 / 2  # at a lever of 10 mm
    flip = np.where(np.arange(len(times)) % 7 < 3, -1, 1)
    still = 0 * times
    values = {"time": times, "x": away[:, 0], "y": away[:, 1], "z": still, "stage": away[:, 0]}
    values |= {"qw": flip * np.cos(half), "qx": still, "qy": still, "qz": flip * np.sin(half)}
    rows = np.column_stack([values[name] for name in names])
    return "\n".join([",".join(names), *(",".join(f"{x:.9f}" for x in row) for row in rows)])


@pytest.mark.parametrize(
    ("names", "column"),
    [
        (("time", "x", "y", "z"), None),
        (("time", "stage"), "stage"),
        (("time", "qw", "qx", "qy", "qz"), None),
        (("time", "x", "y", "z", "qw", "qx", "qy", "qz"), "x"),
    ],
    ids=["poses", "a stage", "a motion sensor", "one of many"],
)
def test_other_instruments_give_the_same_onsets(tmp_path, names, column):
    path = tmp_path / "stage.csv"
    path.write_text(measured(names))
    labels = propose("tracking", recording(), motion=path, column=column)
    assert list(labels) == ["thumb", "index"]  # the object moves against the whole hand
    for finger in labels:
        found = check_onsets(labels, 0.03, finger)
        sizes = [float(label.evidence.split()[1]) for label in found]
        assert sizes == pytest.approx([size for _, size in SLIPS], abs=0.15)
        assert offset_of(found[0]) == pytest.approx(SHIFT, abs=0.01)


TURNS = "time,qw,qx,qy,qz\n" + "".join(f"{k},3,0,0,0\n" for k in range(200))
REST = "time,a\n" + "".join(f"{k / 50},0\n" for k in range(1000))
BAD_MOTIONS = {
    "no motion": ("time,a\n" + "1,2\n" * 200, None, "columns time, a; time and x,y,z"),
    "no such column": ("time,a\n" + "1,2\n" * 200, "b", "'b'"),
    "too short": ("time,a\n1,2\n", "a", "1 times"),
    "no turns": (TURNS, None, "qw,qx,qy,qz"),
    "at rest": (REST, "a", "its motion"),
}


@pytest.mark.parametrize(("text", "column", "message"), BAD_MOTIONS.values(), ids=BAD_MOTIONS)
def test_motions_that_cannot_be_used(tmp_path, text, column, message):
    path = tmp_path / "stage.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message):
        propose("tracking", recording(), motion=path, column=column)


def test_something_must_be_measured():
    with pytest.raises(ValueError, match="video"):
        video.propose(recording())


def test_a_flash_gives_the_offset_of_clocks(film, monkeypatch):
    times, found = sticker_track()
    generator = np.random.default_rng(4)
    levels = 90 + generator.normal(0, 0.2, len(times))
    # A lamp is switched on at 7 s; the page lights up twice, one picture before its marker.
    levels[times > 7.0] += 20
    for start in (1.2, 30.5):
        levels[(times > start) & (times < start + 0.4)] += 8
    film(times, found, levels)
    pulls = recording()
    markers = [(t + SHIFT + 0.02, "flash") for t in (1.2, 30.5)]
    marked = replace(pulls, markers=tuple(markers))
    check_onsets(propose("tracking", marked, video="run.mp4"), 0.02)


@pytest.mark.parametrize("levels", [np.zeros(0), np.full(50, 90.0)])
def test_a_flash_that_is_not_seen_counts_for_nothing(levels):
    marked = replace(recording(), markers=((3.0, "flash"),))
    assert video_clock.flash_offset(marked, np.arange(len(levels)) / 60, levels) is None


class TestSureHold:
    """What may slide is unstable without a cause, or has no label."""

    TIMES = np.arange(0.0, 10.0, 0.1)
    PUSH = Label(2.0, 8.0, "UNSTABLE", "disturbance")
    HOLD = Label(8.0, 9.0, "STABLE")

    def spans(self, *doubtful, labels=(PUSH, HOLD), times=TIMES):
        mask = np.zeros(len(times), dtype=bool)
        for first, last in doubtful:
            mask[first:last] = True
        made = video.surely_held(labels, times, mask)
        return [(round(x.start, 3), round(x.end, 3), x.cause) for x in made]

    @pytest.mark.parametrize(
        ("doubtful", "parts"),
        [
            ((), [(2.0, 8.0, "disturbance"), (8.0, 9.0, None)]),
            (
                ((30, 41), (82, 85)),
                [
                    (2.0, 3.0, "disturbance"),
                    (3.0, 4.0, None),
                    (4.0, 8.0, "disturbance"),
                    (8.0, 8.2, None),
                    (8.4, 9.0, None),
                ],
            ),
            (((0, 100),), [(2.0, 8.0, None)]),
        ],
    )  # fmt: skip
    def test_labels_are_cut(self, doubtful, parts):
        assert self.spans(*doubtful) == parts

    @pytest.mark.parametrize(
        ("within", "after", "way"),
        [(0.0, 0.0, 0.0), (0.1, 0.0, 0.05), (0.1, 0.1, 0.1), (0.0, 0.15, 0.15)],
    )
    def test_a_push_is_held_where_the_finger_comes_back(self, within, after, way):
        rest = np.random.default_rng(0).normal(0, 0.003, (300, 2))
        rest[100:150, 0] += within
        rest[150:, 0] += after
        assert max(video.moved_by(rest, slice(100, 150), 18)) == pytest.approx(way, abs=0.01)

    def test_where_nothing_is_seen_before_or_after_it_may_slide(self):
        assert video.moved_by(np.zeros((50, 2)), slice(0, 20), 18)[0] == np.inf
        assert video.moved_by(np.zeros((50, 2)), slice(20, 50), 18)[0] == np.inf

    def test_what_no_picture_shows_is_doubtful(self, film, monkeypatch):
        times, found = sticker_track()
        film(times, found)
        seen = video.tip_motions

        def half_seen(*arguments):
            tips = seen(*arguments)
            tips["index"] = tips["index"]._replace(seen=times < 20)
            return tips

        monkeypatch.setattr(video, "tip_motions", half_seen)
        labels = video.propose(recording(), "run.mp4")["index"]
        pushes = [x for x in labels if x.state == "UNSTABLE" and x.start > 20.5 and x.end < 36]
        assert pushes
        assert not any(x.cause for x in pushes)
