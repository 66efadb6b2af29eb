"""Make the film of the live page for the front page of the site: docs/img/live.webp.

    uv run --group dev python site/film.py [OUT]

`holdfast serve` replays the recording that ships at half its speed, again and again, and a
browser without a display takes the pictures. It needs Chromium.
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

OUT = Path(__file__).parents[1] / "docs" / "img" / "live.webp"
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
    """Write the film."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    with served() as url, sync_playwright() as playwright:
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(executable_path=chromium, args=OPTIONS)
        page = browser.new_page(viewport=VIEW, color_scheme="light")
        page.goto(url)
        page.wait_for_function("() => /starts again/.test(document.body.innerText)", timeout=60_000)
        pictures = [Image.open(BytesIO(picture)) for picture in pictures_of(page)]
        browser.close()
    frames = [picture.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS) for picture in pictures]
    frames[0].save(
        out, save_all=True, append_images=frames[1:], duration=round(1000 * FRAME_PERIOD), loop=0,
        quality=QUALITY, method=4, minimize_size=True,
    )  # fmt: skip
    sys.stdout.write(f"{out}: {len(frames)} pictures, {out.stat().st_size / 1e6:.2f} MB\n")


@contextmanager
def served() -> Iterator[str]:
    """Serve the page, and give its address; the film shows the name of the copied recording."""
    holdfast = str(Path(sys.executable).with_name("holdfast"))
    words = ["serve", "builtin:any", BOX_SLIPS.name, "--port", "0", "--speed", "0.5", "--json"]
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(BOX_SLIPS, folder)
        process = subprocess.Popen(
            [holdfast, *words], stdout=subprocess.PIPE, text=True, cwd=folder
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
