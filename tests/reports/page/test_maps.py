"""Maps in a real browser: what a pointer and the table of numbers say of a field, of an action, and of staying."""

import numpy as np
import pytest
from gymnasium import spaces
from reports.page.made_runs import scene_of, table_run

from irl_gym.reports.comparison.comparison_page import SCRIPTS
from irl_gym.reports.page import maps
from irl_gym.reports.page.document import write_page
from irl_gym.reports.page.maps import Map
from irl_gym.reports.page.sections.compared import reward_panel
from irl_gym.reports.page.sections.section import Section, specs
from irl_gym.spaces.coordinates import Coordinates
from irl_gym.tables.cells import Cells
from irl_gym.tables.layouts import GridLayout

NAMES = ("up", "right", "down", "left", "<b>wait")
DIRECTIONS = np.array([[-1, 0], [0, 1], [1, 0], [0, -1], [0, 0]])


def place_of(directions=DIRECTIONS):
    closed = np.zeros((2, 2), dtype=bool)
    letters = np.array([["S", ""], ["", "G"]])
    return Map(GridLayout((2, 2), directions, closed, np.array([[False, False], [False, True]]), letters))


def plane_of():
    low, high = np.array([-1.0, 0.0]), np.array([1.0, 4.0])
    space = spaces.Box(low.astype(np.float32), high.astype(np.float32))
    cells = Cells(Coordinates(space, ("position", "the_speed"), low, high, np.zeros(2, dtype=bool)), 2)
    nowhere, closed = np.zeros((5, 2), dtype=int), np.zeros((2, 2), dtype=bool)
    return Map(GridLayout((2, 2), nowhere, closed, closed, np.full((2, 2), "", dtype="<U1")), cells)


EVERY = np.ones(4, dtype=bool)
PAID = np.arange(20.0).reshape(4, 5) / 8


@pytest.fixture(scope="module")
def page(tmp_path_factory, browser):
    path = tmp_path_factory.mktemp("maps") / "maps.html"
    place, acts = place_of(), np.eye(5, dtype=bool)[[4, 0, 4, 1]]
    acts[2, 0] = True
    panels = [
        maps.crosses("crossed", "Crossed", place, PAID, NAMES, caption="", shown=EVERY),
        maps.choices("chosen", "Chosen", place, np.array([0.0, 4.0, np.nan, 2.0]), NAMES, caption=""),
        maps.choices("plane", "Plane", plane_of(), np.array([0.0, 4.0, np.nan, 2.0]), NAMES, caption=""),
        maps.arrows("acts", "Acts", place, acts, caption="", shown=EVERY),
    ]
    sections = [Section("maps", "Maps", "", panels)]
    context = {"title": "Maps", "facts": [], "sentence": "", "sections": sections}
    write_page(path, "compare.html", context, {"figures": specs(sections), "slider": None, "episodes": {}}, SCRIPTS)
    return path


def numbers(page, name):
    page.evaluate(f"document.querySelector('details[data-of={name}]').open = true")
    page.until(f"document.querySelector('details[data-of={name}] table')")
    return page.evaluate(
        f"[...document.querySelectorAll('details[data-of={name}] tr')].map(one => [...one.cells].map(cell => cell.textContent))"
    )


def hovered(page, name, x, y):
    """What is said where the pointer is, in cells of the map."""
    page.locator(f"#{name}").scroll_into_view_if_needed()
    at = page.evaluate(
        f"""(() => {{ const box = document.getElementById('{name}'), {{xaxis, yaxis}} = box._fullLayout;
        const corner = box.getBoundingClientRect();
        return [corner.x + xaxis._offset + xaxis.l2p({x}), corner.y + yaxis._offset + yaxis.l2p({y})] }})()"""
    )
    page.mouse.move(*at)
    page.until(f"document.querySelector('#{name} .hovertext')")
    return page.locator(f"#{name} .hovertext").text_content()


def test_the_numbers_of_a_crossed_map_name_row_column_and_action(page, look):
    headings, *rows = numbers(look(page), "crossed")
    assert headings == ["row", "column", "action", "value"] and len(rows) == 20
    assert rows[10:15] == [
        ["1", "0", "up", "1.25"], ["1", "0", "left", "1.625"], ["1", "0", "<b>wait", "1.75"],
        ["1", "0", "right", "1.375"], ["1", "0", "down", "1.5"],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("x", "y", "told"),
    [
        (0, -1 / 3, "row 0, column 0, up: 0"),
        (1 / 3, 1, "row 1, column 0, right: 1.375"),
        (1, 0, "row 0, column 1, <b>wait: 1.125"),
    ],
)
def test_a_pointer_on_a_field_is_told_its_cell_and_action(page, look, x, y, told):
    assert hovered(look(page), "crossed", x, y) == told


def test_choices_are_named(page, look):
    assert numbers(look(page), "chosen") == [
        ["row", "column", "action"], ["0", "0", "up"], ["0", "1", "<b>wait"], ["1", "1", "down"],
    ]  # fmt: skip
    assert hovered(look(page), "chosen", 1, 1) == "row 1, column 1: down"


def test_choices_on_a_plane_are_named_beside_their_coordinates(page, look):
    assert numbers(look(page), "plane") == [
        ["the speed", "position", "action"], ["1", "-0.5", "up"], ["3", "-0.5", "<b>wait"], ["3", "0.5", "down"],
    ]  # fmt: skip


def test_an_action_that_stays_is_a_dot_in_its_cell(page, look):
    x, y = look(page).evaluate("(({x, y}) => [x, y])(document.getElementById('acts').data[1])")
    shapes, last = [], []
    for one in zip(x, y, strict=True):
        if one[0] is None:
            shapes.append(np.array(last))
            last = []
        else:
            last.append(one)
    dots = [shape for shape in shapes if len(shape) == 17]
    assert len(shapes) == 5 and [dot[:-1].mean(axis=0).round(9).tolist() for dot in dots] == [[0, 0], [0, 1]]
    assert np.ptp(dots[0][:, 0]) > np.ptp(dots[1][:, 0])  # the second is beside an arrow


def test_an_action_that_stays_is_a_field_of_its_own():
    assert maps.has_crosses(place_of())


def test_two_actions_that_stay_are_no_fields():
    assert not maps.has_crosses(place_of(np.array([[0, 1], [0, 0], [0, 0]])))


@pytest.mark.parametrize(("directions", "off"), [(DIRECTIONS, 0.36), (DIRECTIONS[:4], 0.0)])
def test_letters_leave_the_middle_of_a_cell_to_staying(directions, off):
    n = len(directions)
    panel = maps.crosses("a", "A", place_of(directions), PAID[:, :n], NAMES[:n], caption="", shown=EVERY)
    letters = next(one for one in panel.figure.data if one.name == "letters")
    assert list(letters.x) == [-off, 1 - off]


def test_the_reward_of_steps_of_a_run_names_the_moves(tmp_path):
    scene = scene_of(table_run(tmp_path, "CliffWalking-v1", reward_on="state-action", films=False))
    spec = reward_panel("true", "True", scene.table.reward, scene).spec()
    assert spec["fields"] == [["", "up", ""], ["left", "", "right"], ["", "down", ""]]
