"""Fake services of the pages, and waiting, for tests in a browser."""

import asyncio
import re
import threading
from importlib import resources
from pathlib import Path

import pytest
from aiohttp import web

from holdfast.web.guard import SECURITY_HEADERS

DESKTOP, PHONE = (1280, 720), (390, 844)
SHARED = Path(str(resources.files("holdfast.web"))) / "static"
HOSTILE = "<img src=x onerror=alert(1)>"
"""Name that would run a script if a page took it for HTML."""

on_both = pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])


def until(page, script, arg=None):
    """Wait until a script is true. (Playwright's own function uses eval, which is forbidden.)"""
    for _ in range(600):
        if page.evaluate(script, arg):
            return
        page.wait_for_timeout(30)
    raise AssertionError(f"never true: {script} {arg}")


def shows(page, selector, text):
    """Wait until the text of the first matching element matches a pattern."""
    for _ in range(600):
        found = page.evaluate("(at) => document.querySelector(at)?.innerText ?? ''", selector)
        if re.search(text, found):
            return
        page.wait_for_timeout(30)
    raise AssertionError(f"{selector} shows {found!r}, never {text!r}")


class PageService:
    """Fake service of a page, on its own port and in its own thread.

    A subclass has the folder of the page, and `routes`: (method, path, handler).
    """

    folder = Path()

    def __init__(self, port=0):
        self.port = port

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    def __enter__(self):
        ready = threading.Event()
        self.thread = threading.Thread(target=lambda: asyncio.run(self.serve(ready)))
        self.thread.start()
        if not ready.wait(20):
            raise RuntimeError("the fake service did not start")
        return self

    def __exit__(self, *_):
        self.loop.call_soon_threadsafe(self.done.set)
        self.thread.join(20)

    async def serve(self, ready):
        self.loop, self.done = asyncio.get_running_loop(), asyncio.Event()
        app = web.Application(middlewares=[self.guard])
        app.router.add_get("/", self.index)
        app.router.add_static("/page", self.folder)
        app.router.add_static("/web", SHARED)
        for method, path, handler in self.routes():
            app.router.add_route(method, path, handler)
        runner = web.AppRunner(app, shutdown_timeout=0.2)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", self.port).start()
        self.port = runner.addresses[0][1]
        ready.set()
        player = asyncio.create_task(self.play())
        await self.done.wait()
        player.cancel()
        await asyncio.gather(player, return_exceptions=True)
        await runner.cleanup()

    async def play(self):
        """Send what the page receives without a request."""

    async def index(self, _):
        return web.FileResponse(self.folder / "index.html")

    async def refused(self, request):
        """Return a reply that refuses a request, or None."""

    @web.middleware
    async def guard(self, request, handler):
        answer = await self.refused(request)
        if answer is None:
            answer = await handler(request)
        if not answer.prepared:
            answer.headers.update(SECURITY_HEADERS)
        return answer
