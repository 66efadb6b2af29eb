"""player.js: playback with and without a video."""

import base64

import pytest

from labelling.page.actions import click, ready, shows, until
from labelling.page.fake_service import FakeService, Recording

RECORD = """async () => {
  const canvas = Object.assign(document.createElement("canvas"), { width: 64, height: 48 });
  const context = canvas.getContext("2d"), recorder = new MediaRecorder(canvas.captureStream(20));
  const parts = [];
  recorder.ondataavailable = ({ data }) => parts.push(data);
  recorder.start();
  for (let k = 0; k < 30; k += 1) {
    context.fillStyle = k % 2 ? "red" : "blue";
    context.fillRect(0, 0, 64, 48);
    await new Promise((done) => setTimeout(done, 50));
  }
  await new Promise((done) => { recorder.onstop = done; recorder.stop(); });
  const bytes = new Uint8Array(await new Blob(parts).arrayBuffer());
  return btoa(String.fromCharCode(...bytes));
}"""
MEDIA = [{"index": 0, "name": "wrist.webm", "offset": 4.0, "missing": False}]


@pytest.fixture
def video(visit, service, tmp_path):
    """Return the path of a video of about 1.5 s, recorded by the browser."""
    page, path = visit(service.url), tmp_path / "wrist.webm"
    try:
        path.write_bytes(base64.b64decode(page.evaluate(RECORD)))
    except Exception as problem:
        pytest.skip(f"this browser records no video: {problem}")
    return path


def test_the_video_follows_the_cursor_and_the_cursor_follows_playback(visit, video):
    with FakeService(Recording(media=MEDIA), media=video) as service:
        page = visit(service.url)
        ready(page)
        until(page, "document.querySelector('#video').readyState >= 2")
        click(page, "thumb", 4.5)
        until(page, "Math.abs(document.querySelector('#video').currentTime - 0.5) < 0.1")
        page.fill("#offset", "4.2")
        page.keyboard.press("Enter")
        until(page, "Math.abs(document.querySelector('#video').currentTime - 0.3) < 0.1")
        page.keyboard.press("Escape")
        click(page, "thumb", 3.5)  # before the video begins
        page.keyboard.press(" ")
        until(page, "!document.querySelector('#video').paused")
        assert page.evaluate("holdfast.player.time") > 4.1
        until(page, "holdfast.player.time > 6.5")  # time continues after the end of the video
        page.keyboard.press(" ")
        stopped = page.evaluate("holdfast.player.time")
        page.wait_for_timeout(200)
        assert page.evaluate("holdfast.player.time") == stopped
        page.reload()
        ready(page)
        assert page.locator("#offset").input_value() == "4.2"


@pytest.mark.parametrize(
    ("missing", "media", "text"),
    [
        (True, None, "wrist.webm was not found beside the recording"),
        (False, b"this is no video", "wrist.webm cannot be played"),
        (False, None, "wrist.webm cannot be played"),
    ],
)
def test_a_video_that_cannot_be_shown(visit, tmp_path, missing, media, text):
    described, path = [{**MEDIA[0], "missing": missing}], tmp_path / "wrist.webm"
    path.write_bytes(media or b"")
    with FakeService(Recording(media=described), media=path if media else None) as service:
        page = visit(service.url)
        ready(page)
        shows(page, "#video-problem", text)
        assert page.locator("#video").is_hidden()
        page.keyboard.press(" ")
        until(page, "holdfast.player.time > 0.3")


def test_playback_without_a_video_moves_the_window(visit, service):
    page = visit(service.url)
    ready(page)
    assert page.locator("#video-box").is_hidden()
    page.evaluate("holdfast.view.setWindow(10, 11)")
    click(page, "thumb", 10.8)
    page.select_option("#rate", "2")
    page.click("#play")
    until(page, "holdfast.view.start > 10.5")
    page.evaluate("holdfast.player.seek(29.9)")
    until(page, "!holdfast.player.playing")  # playback stops at the end
    assert page.evaluate("holdfast.player.time") == pytest.approx(service.recordings[0].end)
