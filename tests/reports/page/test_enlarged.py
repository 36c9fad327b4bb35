"""Figures are enlarged and zoomed, with mouse and keyboard; and nothing is wider than a phone."""

import pytest
from reports.page.made_runs import stepped_run, table_run

from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.page.report import write_report

WIDER = """[...document.querySelectorAll('body *')]
    .filter(one => one.getClientRects().length && !one.closest('.scroll, .contents, .unseen, .skip, svg'))
    .filter(one => one.getBoundingClientRect().right > innerWidth + 1 || one.getBoundingClientRect().left < -1)
    .map(one => `${one.tagName} ${one.className}`)"""
CUT = """[...document.querySelectorAll('.scroll')].filter(one => one.getBoundingClientRect().right > innerWidth + 1).length"""
SPAN = "(range => Math.abs(range[1] - range[0]))(document.querySelector('#{}').layout.xaxis.range)"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("enlarged")
    lake, bars = table_run(folder / "lake", errors=3), table_run(folder / "cards", "Blackjack-v1", errors=20, sab=False)
    cart = stepped_run(folder / "cart")
    for name, run in {"lake": lake, "bars": bars, "cart": cart}.items():
        write_report(run, folder / f"{name}.html")
    write_comparison([lake, table_run(folder / "other", errors=5, seed=1), bars, cart], folder / "compared.html")
    return {name: folder / f"{name}.html" for name in ("lake", "bars", "cart", "compared")}


@pytest.mark.parametrize("name", ["lake", "bars", "cart", "compared"])
def test_no_element_is_wider_than_a_phone_and_tables_scroll_inside(pages, look, name):
    page = look(pages[name], width=390)
    assert page.evaluate(WIDER) == [] and page.evaluate(CUT) == 0


def test_a_figure_is_zoomed_by_a_frame_and_shown_whole_by_a_double_click(pages, look):
    page = look(pages["lake"])
    figure = page.locator("#curve-value")
    figure.scroll_into_view_if_needed()
    box, whole = figure.locator(".nsewdrag").first.bounding_box(), page.evaluate(SPAN.format("curve-value"))
    at = [(box["x"] + share * box["width"], box["y"] + share * box["height"]) for share in (0.2, 0.6)]
    page.mouse.move(*at[0])
    page.mouse.down()
    page.mouse.move(*at[1], steps=5)
    page.mouse.up()
    page.until(f"{SPAN.format('curve-value')} < {0.6 * whole}")
    page.mouse.dblclick(*at[0])
    page.until(f"{SPAN.format('curve-value')} > {0.99 * whole}")


def test_a_figure_is_enlarged_and_zoomed_with_the_keyboard_alone(pages, look):
    page = look(pages["lake"])
    button = page.locator("[data-of=curve-value].enlarge")
    button.focus()
    page.keyboard.press("Enter")
    page.until("document.querySelector('#enlarged .modebar-btn[tabindex=\"0\"]') !== null")
    assert page.locator("#enlarged-title").inner_text() == "Value"
    large = "document.querySelector('#enlarged .js-plotly-plot').layout.xaxis.range"
    span = f"Math.abs({large}[1] - {large}[0])"
    before = page.evaluate(span)
    for _ in range(12):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.dataset.title") == "Zoom in":
            break
    page.keyboard.press("Enter")
    page.until(f"{span} < {0.9 * before}")
    page.keyboard.press("Escape")
    assert not page.locator("#enlarged").is_visible()
    assert page.evaluate("document.activeElement.dataset.of") == "curve-value"


def test_a_picture_of_an_episode_is_enlarged(pages, look):
    page = look(pages["lake"])
    page.locator("[data-of=player-agent].enlarge").click()
    small, large = (page.locator(f"{where} svg").bounding_box() for where in ("#player-agent .stage", "#enlarged .large"))
    assert large["height"] > 1.2 * small["height"]
    page.locator("#enlarged").get_by_role("button", name="Close").click()
    assert not page.locator("#enlarged").is_visible()
