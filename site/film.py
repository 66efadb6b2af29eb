"""Make the picture of the live page, docs/img/live.png, and its film, docs/img/live.webp.

    uv run --group dev python site/film.py [FOLDER]

The picture is of a grasp of the twin in which some fingers have slid and others are stable. For the
film, `holdfast serve` replays the recording that ships at half its speed, again and again. A
browser without a display takes both. It needs Chromium, and a machine that is not busy.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from holdfast.demo_data import BOX_SLIPS

OUT = Path(__file__).parents[1] / "docs" / "img"
PICTURE, PICTURE_SIZE = (
    ("builtin:twin", "twin:?object=bottle&seed=3"),
    {"width": 1280, "height": 720},
)
"""Model and source of the picture, and its size [pixels]."""
MIXED = """() => {
  const text = document.body.innerText, states = text.match(/\\b(UN)?STABLE\\b/g) ?? [];
  return /slid \\d/.test(text) && states.includes("STABLE") && states.includes("UNSTABLE");
}"""
"""Script that returns whether the page shows a slip, and fingers in both states."""
FILM = ("builtin:any", BOX_SLIPS.name, "--speed", "0.5")
DURATION = 9.6
"""Of the film [s]: one replay of the recording at half its speed."""
FRAME_PERIOD = 0.25
"""Time between two pictures [s]."""
VIEW = {"width": 1280, "height": 800}
SIZE = (960, 600)
"""Of the film [pixels]."""
QUALITY = 45
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


def main() -> None:
    """Write the picture, then the film."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    with opened(*PICTURE, size=VIEW) as page:
        is_mixed = False
        while not is_mixed:  # also once the picture is taken
            page.wait_for_function(MIXED, timeout=180_000)
            page.screenshot(path=folder / "live.png")
            is_mixed = page.evaluate(MIXED)
    out = folder / "live.webp"
    with opened(*FILM, size=VIEW) as page:
        page.wait_for_function("() => /starts again/.test(document.body.innerText)", timeout=60_000)
        pictures = [Image.open(BytesIO(picture)) for picture in pictures_of(page)]
    frames = [picture.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS) for picture in pictures]
    frames[0].save(
        out, save_all=True, append_images=frames[1:], duration=round(1000 * FRAME_PERIOD), loop=0,
        quality=QUALITY, method=4, minimize_size=True,
    )  # fmt: skip
    sys.stdout.write(f"{out}: {len(frames)} pictures, {out.stat().st_size / 1e6:.2f} MB\n")


@contextmanager
def opened(*words: str, size: Any) -> Iterator[Any]:
    """Serve a model and source, and open the page; the film shows the name of the recording."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with served(*words) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=OPTIONS)
        page = browser.new_page(viewport=size, color_scheme="light")
        page.goto(url)
        yield page
        browser.close()


@contextmanager
def served(*words: str) -> Iterator[str]:
    """Serve a model and source, in a folder with a copy of the recording; give the address."""
    holdfast = str(Path(sys.executable).with_name("holdfast"))
    options = ["--port", "0", "--json", "--no-browser"]
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(BOX_SLIPS, folder)
        process = subprocess.Popen(
            [holdfast, "serve", *words, *options], stdout=subprocess.PIPE, text=True, cwd=folder
        )
        try:
            yield json.loads(process.stdout.readline() if process.stdout else "null")["url"]
        finally:
            process.terminate()
            process.wait(timeout=10)


def pictures_of(page: Any) -> Iterator[bytes]:
    """Yield the pictures of the page, one each `FRAME_PERIOD`."""
    begun = time.monotonic()
    for number in range(round(DURATION / FRAME_PERIOD)):
        time.sleep(max(0.0, begun + number * FRAME_PERIOD - time.monotonic()))
        yield page.screenshot()


if __name__ == "__main__":
    main()
