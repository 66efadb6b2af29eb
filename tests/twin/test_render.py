"""Pictures show hand, object and forces; films keep their pictures; errors are one line."""

import os
import shutil
import stat
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image, ImageSequence

from holdfast.errors import OutputError
from holdfast.twin import render as module
from holdfast.twin.grasp import closing_path, object_pose
from holdfast.twin.hand import N_JOINTS, HandModel
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import load_objects, object_named
from holdfast.twin.render import Camera, Renderer, check_film, save_video

BLUE, ORANGE, RED = (0.36, 0.62, 0.80), (0.95, 0.55, 0.18), module.ARROW_COLOUR[:3]


def held(name="can"):
    hand = HandModel.build(object_named(name))
    hand.data.qpos[:N_JOINTS] = closing_path(object_named(name)).targets(np.zeros(4))
    hand.data.qpos[N_JOINTS : N_JOINTS + 3], turn = object_pose(object_named(name))
    hand.data.qpos[N_JOINTS + 3 :] = np.cos(turn / 2), 0, 0, np.sin(turn / 2)
    mujoco.mj_forward(hand.model, hand.data)
    return hand


@pytest.fixture(scope="module")
def hand():
    return held()


@pytest.fixture(scope="module")
def renderer(hand):
    try:
        renderer = Renderer(hand.model, 160, 120)
    except OutputError as cause:
        pytest.skip(str(cause))
    yield renderer
    renderer.close()


def render(hand, camera=None, forces=None):
    with Renderer(hand.model, 160, 120, camera) as renderer:
        return renderer.picture(hand.data, forces)


def share(picture, colour):
    """Of the pixels that have the hue of a colour: what its channels are to the largest."""
    pixels = picture.reshape(-1, 3).astype(float)
    brightest = pixels.max(axis=1, keepdims=True)
    wanted = np.array(colour) / max(colour)
    return float((np.abs(pixels / np.maximum(brightest, 1) - wanted).max(axis=1) < 0.13).mean())


def films():
    """Pictures that differ a lot, and whose colours survive 256 of them."""
    shades = np.zeros((5, 24, 32, 3), dtype=np.uint8)
    shades[:, :, :16] = np.arange(5)[:, None, None, None] * 60
    shades[:, :, 16:, 0] = 200
    return list(shades)


class TestPictures:
    def test_show_object_and_fingertips_before_a_light_background(self, renderer, hand):
        picture = renderer.picture(hand.data)
        assert picture.shape == (120, 160, 3)
        assert picture.dtype == np.uint8
        assert (picture[:4] > 220).all()
        assert 0.05 < share(picture, BLUE) < 0.4
        assert 0.01 < share(picture, ORANGE) < 0.2
        assert share(picture, RED) == 0.0

    @pytest.mark.parametrize("name", [name for name in load_objects() if name != "can"])
    def test_show_every_shape(self, renderer, name):
        other = held(name)
        picture = render(other)
        assert 0.03 < share(picture, BLUE) < 0.4

    def test_show_forces_as_arrows_that_end_at_their_points(self, renderer, hand):
        view = Camera((0.3, 0.0, 0.0), 0.3, 180.0, 0.0)  # looks along -x, right is y
        force = 0.05 / module.ARROW_LENGTH_PER_NEWTON
        forces = np.array([[0.3, 0.04, 0.0, 0.0, force, 0.0]])
        before = render(hand, view)
        after = render(hand, view, forces)
        changed = np.flatnonzero((before != after).any(axis=(0, 2)))
        height = 2 * 0.3 * np.tan(np.radians(hand.model.vis.global_.fovy / 2))
        heights = (changed + 0.5 - 80) / 120 * height
        assert heights.max() == pytest.approx(0.04, abs=0.004)
        assert heights.min() == pytest.approx(-0.01, abs=0.004)

    @pytest.mark.parametrize("size", [(0, 10), (10, -1), (5000, 100)])
    def test_of_an_invalid_size_are_refused(self, hand, size):
        with pytest.raises(ValueError, match="picture"):
            Renderer(hand.model, *size)


class TestFilms:
    @pytest.mark.parametrize("suffix", [".gif", ".png", ".webp", ".GIF"])
    def test_keep_their_pictures_and_their_pace(self, tmp_path, suffix):
        path = tmp_path / f"film{suffix}"
        save_video(iter(films()), path, 20.0)
        with Image.open(path) as film:
            assert film.n_frames == 5
            for image, expected in zip(ImageSequence.Iterator(film), films(), strict=True):
                got = np.asarray(image.convert("RGB")).astype(int)
                assert np.abs(got - expected).mean() < 8
                assert image.info["duration"] == pytest.approx(50.0)

    @pytest.mark.parametrize("name", ["film.avi", "film", "film.png.txt"])
    def test_of_no_format_are_refused(self, tmp_path, name):
        with pytest.raises(ValueError, match="suffix"):
            save_video(films(), tmp_path / name, 20.0)
        assert not list(tmp_path.iterdir())

    def test_as_mp4_need_ffmpeg(self, monkeypatch):
        monkeypatch.setattr(shutil, "which", lambda name: None)
        with pytest.raises(OutputError, match="ffmpeg"):
            check_film("film.mp4")
        check_film("film.webp")

    def test_as_mp4_are_piped_to_ffmpeg(self, tmp_path, monkeypatch):
        stand_in(tmp_path, monkeypatch, 'cat > "$(eval echo \\${$#})"')
        save_video(films(), tmp_path / "film.mp4", 20.0)
        assert (tmp_path / "film.mp4").read_bytes() == b"".join(f.tobytes() for f in films())

    def test_have_the_error_of_ffmpeg(self, tmp_path, monkeypatch):
        stand_in(tmp_path, monkeypatch, "echo first >&2; echo no space >&2; exit 1")
        big = [np.zeros((400, 400, 3), dtype=np.uint8)] * 3  # more than a pipe holds
        with pytest.raises(OutputError, match="no space"):
            save_video(big, tmp_path / "film.mp4", 20.0)


def stand_in(folder, monkeypatch, script):
    program = folder / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")


def test_the_choice_of_a_back_end_leaves_the_environment_as_it_was():
    code = (
        "import os; before = dict(os.environ)\n"
        "import holdfast.twin.render\n"
        "print(before == dict(os.environ))"
    )
    environment = {key: value for key, value in os.environ.items() if "GL" not in key}
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert run.stdout == "True\n"
