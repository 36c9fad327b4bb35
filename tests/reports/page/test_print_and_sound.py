"""A page on paper, and a page that is read out."""

import pytest
from reports.page.made_runs import table_run

from irl_gym.reports.page.report import write_report


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    folder = tmp_path_factory.mktemp("print")
    write_report(table_run(folder, errors=3), folder / "grid.html")
    write_report(table_run(folder, "CliffWalking-v1", frames=True), folder / "cliff.html")
    return folder


@pytest.fixture
def page(grid, visit):
    return visit(grid / "grid.html")


INK = """[getComputedStyle(document.documentElement).getPropertyValue('--ink'),
    document.getElementById('value-expert').layout.font.color]"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_paper_is_light_and_so_are_its_figures(page, scheme):
    page.emulate_media(color_scheme=scheme)
    if scheme == "light":
        page.locator("#theme").click()  # dark by the button; else by the system
    page.until_true(lambda: page.evaluate(INK) == ["#e8ebf1"] * 2, "dark ink")
    dark = page.evaluate(INK)
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print", color_scheme=scheme)
    on_paper = page.evaluate(INK)
    page.emulate_media(media="screen", color_scheme=scheme)
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert dark == ["#e8ebf1"] * 2 and on_paper == ["#1c2230"] * 2 and page.evaluate(INK) == dark


def test_the_style_alone_makes_paper_light(page):
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.emulate_media(media="print", color_scheme="dark")
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(28, 34, 48)"


def test_buttons_of_the_players_are_told_apart(page):
    names = page.evaluate("[...document.querySelectorAll('.player button')].map(one => one.ariaLabel)")
    assert len(set(names)) == len(names) == 10 and {"Expert: one step back", "Retrained agent: play"} <= set(names)


def test_a_step_by_hand_is_read_out_and_a_film_is_not(page):
    told = page.locator("#player-agent .moment")
    page.locator("#player-agent [data-do=forward]").click()
    by_hand = told.get_attribute("aria-live")
    page.locator("#player-agent [data-do=first]").click()
    page.locator("#player-agent .play").click()
    assert (by_hand, told.get_attribute("aria-live")) == ("polite", "off")


def test_a_picture_says_what_it_shows(grid, visit):
    image = visit(grid / "cliff.html").locator("#player-expert .stage img")
    assert image.get_attribute("alt") == "The environment: row 3, column 0"


def test_a_table_that_scrolls_says_so(page):
    shown = "document.querySelector('#summary .scroll').classList.contains('more')"
    wide = page.evaluate(shown)
    page.set_viewport_size({"width": 320, "height": 800})
    assert not wide
    page.until(shown)
