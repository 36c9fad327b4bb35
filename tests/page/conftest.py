"""A real browser without a screen, and pages opened in it; whatever goes wrong on a page is kept."""

import os
import shutil

import pytest

FLAGS = (
    "--no-sandbox", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
)  # fmt: skip


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


def opened(browser, path, width, **more):
    """A page; `page.wrong` lists errors of the console and of scripts, `page.asked` what was requested."""
    page = browser.new_page(viewport={"width": width, "height": 844}, **more)
    page.wrong, page.asked = [], []
    page.on("console", lambda said: page.wrong.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(path.as_uri())
    page.evaluate("window.drawn")
    return page


@pytest.fixture
def visit(browser):
    """Opens a file for one test, which may press what it likes."""
    pages = []

    def visited(path, *, width=1280, **more):
        pages.append(opened(browser, path, width, **more))
        return pages[-1]

    yield visited
    for page in pages:
        page.close()


@pytest.fixture(scope="module")
def look(browser):
    """Opens a file once for all tests that only look at it."""
    pages = {}

    def looked(path, *, width=1280):
        if (path, width) not in pages:
            pages[path, width] = opened(browser, path, width)
        return pages[path, width]

    yield looked
    for page in pages.values():
        page.close()
