"""report.html in a real browser: figures, slider, episodes, colours, keyboard, phone."""

import json
import re

import pytest
from plotly.offline import get_plotlyjs
from reports.page.made_runs import stepped_run, table_run

from irl_gym.reports.page.report import write_report

SCRIPT = "<script>document.title='taken'</script>"
KINDS = ("grid", "pictures", "bars", "stepped")
DRAWN = "document.querySelectorAll('.plot .main-svg').length >= document.querySelectorAll('.plot').length"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A page of a map, of a map with pictures, of an environment without a map, and of one without a table."""
    folder = tmp_path_factory.mktemp("pages")
    runs = {
        "grid": table_run(folder, errors=3),
        "pictures": table_run(folder, "CliffWalking-v1", frames=True),
        "bars": table_run(folder, "Blackjack-v1", errors=20, sab=False),
        "stepped": stepped_run(folder),
    }
    runs["grid"].config["env_kwargs"]["note"] = SCRIPT
    for name, run in runs.items():
        write_report(run, folder / f"{name}.html")
    return {name: folder / f"{name}.html" for name in runs} | {"run": runs["grid"]}


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_has_no_errors(pages, look, kind):
    page = look(pages[kind])
    assert page.evaluate(DRAWN) and page.locator(".plot").count() >= 3 and page.wrong == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_asks_for_nothing_but_itself(pages, look, kind):
    page = look(pages[kind])
    assert [url for url in page.asked if not url.startswith(("file:", "data:", "blob:"))] == [] and len(page.asked) >= 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_fits_a_phone(pages, look, kind):
    page = look(pages[kind], width=390)
    assert page.evaluate("document.documentElement.scrollWidth") == 390


@pytest.mark.parametrize("kind", KINDS)
def test_no_figure_is_empty_or_wider_than_its_box(pages, look, kind):
    sizes = """[...document.querySelectorAll('.plot')].map(box =>
        [box.clientWidth, box.querySelector('.main-svg').clientWidth, box.clientHeight])"""
    for width in (390, 1280):
        assert all(
            drawn <= box and drawn > 100 and high > 100 for box, drawn, high in look(pages[kind], width=width).evaluate(sizes)
        )


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_small_and_holds_plotly_once(pages, kind):
    text = pages[kind].read_text()
    assert len(text.encode()) < 8_000_000 and text.count(get_plotlyjs()[:5000]) == 1 and text.count("plotly.js v") == 1


def test_the_same_run_makes_the_same_bytes(pages, tmp_path):
    write_report(pages["run"], tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == pages["grid"].read_bytes()
    assert [one.name for one in tmp_path.iterdir()] == ["again.html"]


def test_text_of_the_run_is_never_markup(pages, look):
    page = look(pages["grid"])
    assert page.title() != "taken" and SCRIPT in page.locator("header").inner_text()
    assert SCRIPT not in pages["grid"].read_text() and "<b>tied</b>" in page.locator("#doctor").inner_text()


def reward(page):
    return page.evaluate("document.getElementById('path-reward').data[1].z.flat()")


def test_the_slider_changes_reward_margins_and_picture(pages, look):
    page = look(pages["grid"])
    page.locator("#lambda-range").fill("0")
    page.until("document.getElementById('path-reward').layout.datarevision === 0")
    figure = page.locator("#path-reward")
    before, seen = reward(page), figure.screenshot()
    margins = page.evaluate("document.getElementById('path-margin').data[1].z.flat()")
    page.locator("#lambda-range").fill("3")
    page.until("document.getElementById('path-margin').layout.datarevision === 3")
    page.until_true(lambda: figure.screenshot() != seen, "another picture")
    assert reward(page) != before
    assert page.evaluate("document.getElementById('path-margin').data[1].z.flat()") != margins


def test_the_last_position_is_no_reward_where_every_action_is_best(pages, look):
    page = look(pages["grid"])
    page.locator("#lambda-range").fill("0")
    page.until("document.getElementById('path-policy').layout.datarevision === 0")
    arrows = page.evaluate("document.getElementById('path-policy').data[1].x.length")
    page.locator("#lambda-range").press("End")
    page.until("document.getElementById('path-reward').data[1].z.flat().every(one => one === 0)")
    assert page.evaluate("document.getElementById('path-policy').data[1].x.length") > 2 * arrows
    assert "above" in page.locator("#lambda-told").inner_text()


def test_the_slider_is_reached_and_moved_with_the_keyboard_alone(pages, visit):
    page = visit(pages["grid"])
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "lambda-range":
            break
    said = page.locator("#lambda-told").inner_text()
    page.keyboard.press("ArrowRight")
    assert page.locator("#lambda-range").input_value() == "1" and page.locator("#lambda-told").inner_text() != said
    assert "piece 2 of" in page.locator("#lambda-range").get_attribute("aria-valuetext")


def test_the_slider_moves_bars_where_there_is_no_map(pages, look):
    page = look(pages["bars"])
    before = page.evaluate("document.getElementById('path-reward').data[0].x")
    page.locator("#lambda-range").press("End")
    page.until("document.getElementById('path-reward').data[0].x.every(one => one === 0)")
    assert any(before)


@pytest.mark.parametrize("kind", KINDS)
def test_an_episode_plays_and_pauses(pages, look, kind):
    page = look(pages[kind])
    player = page.locator("#player-agent")
    player.locator("[data-do=first]").click()
    button = player.get_by_role("button", name="Play")
    player.get_by_role("combobox").select_option("10")
    said = player.locator(".moment").inner_text()
    button.click()
    assert player.locator(".play").inner_text() == "Pause"
    page.until(f"document.querySelector('#player-agent .moment').innerText !== {json.dumps(said)}")
    player.locator("[data-do=first]").click()
    assert player.locator(".play").inner_text() == "Play" and player.locator(".position").input_value() == "0"


@pytest.mark.parametrize(("kind", "shows"), [("grid", "svg .token"), ("pictures", "img"), ("bars", ".words")])
def test_an_episode_moves_what_it_is_shown_by(pages, look, kind, shows):
    page = look(pages[kind])
    stage = page.locator("#player-expert .stage")
    assert stage.locator(shows).count() == 1
    page.locator("#player-expert [data-do=first]").click()
    before = stage.screenshot()
    page.locator("#player-expert .position").press("End")
    page.until_true(lambda: stage.screenshot() != before, "another picture")


def test_the_row_of_the_moment_is_marked(pages, look):
    page = look(pages["bars"])
    page.locator("#player-expert [data-do=first]").click()
    page.locator("#player-expert [data-do=forward]").click()
    assert page.locator("#player-expert tr.now th").inner_text() == "1"


def test_the_button_turns_page_and_figures_dark_and_back(pages, look):
    page = look(pages["grid"])
    colours = "[getComputedStyle(document.body).backgroundColor, document.getElementById('curve-value').layout.font.color]"
    light = page.evaluate(colours)
    page.get_by_role("button", name="Dark colours").click()
    dark = page.evaluate(colours)
    assert dark[0] != light[0] and dark[1] != light[1]
    page.get_by_role("button", name="Light colours").click()
    assert page.evaluate(colours) == light
    page.evaluate("delete document.documentElement.dataset.theme")


def test_dark_is_what_the_system_asks_for(pages, look):
    ask = "getComputedStyle(document.body).backgroundColor"
    dark, light = (look(pages["grid"], color_scheme=scheme).evaluate(ask) for scheme in ("dark", "light"))
    assert dark == "rgb(17, 20, 26)" and light == "rgb(245, 246, 248)"


def test_each_figure_is_named_described_and_has_its_numbers(pages, look):
    page = look(pages["grid"])
    for name in page.evaluate("[...document.querySelectorAll('.plot')].map(one => one.id)"):
        assert page.locator(f"#{name}").get_attribute("role") == "img"
        assert len(page.locator(f"#{name}-title").inner_text()) > 3 and len(page.locator(f"#{name}-caption").inner_text()) > 10
        page.locator(f"details[data-of={name}] summary").click()
        page.locator(f"details[data-of={name}] tbody tr").nth(2).wait_for()  # the table is made when the box is open
        page.locator(f"details[data-of={name}] summary").click()


def test_without_scripts_the_tables_are_there_and_a_sentence_says_so(pages, browser):
    page = browser.new_context(java_script_enabled=False).new_page()
    page.goto(pages["grid"].as_uri())
    assert "Scripts are off" in page.locator("noscript").inner_text() and page.locator("#summary tbody tr").count() == 3
    page.context.close()


def test_sections_stand_in_a_reader_s_order(pages, look):
    shown = look(pages["grid"]).evaluate("[...document.querySelectorAll('main > section')].map(one => one.id)")
    assert shown[1:] == [
        "summary", "rewards", "values", "policies", "learning", "episodes", "distances", "lambda", "widths", "certificate",
        "doctor", "table", "stages", "asked", "reproduce",
    ]  # fmt: skip


def test_a_run_without_a_table_leaves_out_what_needs_one_and_says_so(pages, look):
    page = look(pages["stepped"])
    assert page.locator("#values, #policies, #lambda, #widths").count() == 0 and page.locator("#weights").count() == 1
    assert "no values, policies, lambda slider" in page.locator("#table").inner_text()


def test_the_command_is_shown_and_copied_or_marked(pages, look):
    page = look(pages["grid"])
    assert page.locator("#command").inner_text().startswith("irl-gym run")
    box = page.locator("#reproduce .command")
    box.get_by_role("button", name="Copy").click()
    page.until("document.querySelector('#reproduce .copied').textContent")
    assert re.match("Copied|Marked", box.locator(".copied").inner_text())


def test_a_run_from_python_has_lines_of_python(pages, look):
    command = look(pages["stepped"]).locator("#command").inner_text()
    assert "recover_and_retrain" in command and compile(command, "lines", "exec")


def test_text_can_be_told_from_its_ground(pages, look):
    measured = """() => {
      const light = ([r, g, b]) => [r, g, b].map(v => v / 255).map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
      const rgb = text => text.match(/[\\d.]+/g).map(Number);
      const ground = one => { for (; one; one = one.parentElement) {
        const c = rgb(getComputedStyle(one).backgroundColor); if (c.length < 4 || c[3] > 0) return c; } return [0, 0, 0]; };
      const kinds = 'p, dt, dd, th, td, a, summary, button, figcaption, caption, h1, h2, h3, label, pre';
      return [...document.querySelectorAll(kinds)]
        .filter(one => one.textContent.trim() && one.offsetParent && !one.closest('.skip'))
        .map(one => { const [a, b] = [rgb(getComputedStyle(one).color), ground(one)].map(light).sort((x, y) => y - x);
          return [(a + 0.05) / (b + 0.05), one.textContent.trim().slice(0, 30)]; })
        .filter(([ratio]) => ratio < 4.5); }"""
    for scheme in ("light", "dark"):
        assert look(pages["grid"], color_scheme=scheme).evaluate(measured) == []
