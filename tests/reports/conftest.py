"""A real browser without a screen, and pages opened in it; whatever goes wrong on a page is kept."""

import os
import shutil
import time
from functools import partial

import pytest

FLAGS = (
    "--no-sandbox", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
)  # fmt: skip


HANG = 600
"""Seconds after which a page is taken to hang."""
FITS = """[...document.querySelectorAll('.plot')].every(box =>
    !box.offsetParent || box.querySelector('.main-svg')?.clientWidth === box.clientWidth)"""
"""Is every figure drawn for the width that its box has?"""


@pytest.fixture(scope="session")
def browser():
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        told = f"none of {', '.join(names)} is installed: these tests open pages in a real browser."
        (pytest.fail if os.environ.get("CI") else pytest.skip)(told)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=found, args=list(FLAGS))
        yield launched
        launched.close()


def until(page, expression):
    """Wait for an expression to hold. Playwright's own wait evaluates text inside the page, which the page's policy forbids."""
    until_true(page, lambda: page.evaluate(expression), expression)


def until_true(page, holds, told):
    """Wait for a condition, however slow the machine: the deadline only ends what hangs."""
    deadline = time.monotonic() + HANG
    while not holds():
        assert time.monotonic() < deadline, told
        page.wait_for_timeout(30)


def opened(browser, path):
    """A page; `wrong` lists errors of the console and of scripts, `asked` what was requested, `until` and `until_true` wait."""
    page = browser.new_page(viewport={"width": 1280, "height": 844})
    page.wrong, page.asked, page.until, page.until_true = [], [], partial(until, page), partial(until_true, page)
    page.on("console", lambda said: page.wrong.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(path.as_uri())
    page.evaluate("window.drawn")
    return page


@pytest.fixture
def visit(browser):
    """Opens a file for one test alone: for what depends on how a page is when it is opened."""
    pages = []

    def visited(path):
        pages.append(opened(browser, path))
        return pages[-1]

    yield visited
    for page in pages:
        page.close()


@pytest.fixture(scope="module")
def look(browser):
    """Opens a file once for all tests of a module, since loading Plotly takes the time. Who presses puts things right first.

    A page that is asked for in another width or other colours is changed, as a window is, and drawn again. Nothing that any
    test does may make an error.
    """
    pages = {}

    def looked(path, *, width=1280, color_scheme="light"):
        if path not in pages:
            pages[path] = opened(browser, path)
        page = pages[path]
        page.emulate_media(color_scheme=color_scheme, reduced_motion="reduce")
        if page.viewport_size["width"] != width:
            page.set_viewport_size({"width": width, "height": 844})
            page.until(FITS)
        return page

    yield looked
    assert [page.wrong for page in pages.values() if page.wrong] == []
    for page in pages.values():
        page.close()
