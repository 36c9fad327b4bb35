"""Tables in a real browser: short ones show whole, and only what overflows says that there is more."""

import pytest
from reports.page.made_runs import table_run

from irl_gym.reports.page.report import write_report

BOX = "document.querySelector('[aria-label=\"Where the retrained agent deviates\"]')"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scrolling")
    for name, size, errors in (("short", "4x4", 11), ("long", "8x8", 50)):
        write_report(table_run(folder, errors=errors, films=False, map_name=size), folder / f"{name}.html")
    return {name: folder / f"{name}.html" for name in ("short", "long")}


def box(page):
    return page.evaluate(
        f"(box => [box.className, box.scrollHeight - box.clientHeight, box.querySelectorAll('tbody tr').length])({BOX})"
    )


def test_a_short_table_shows_whole_and_promises_nothing(pages, look):
    kinds, hidden, rows = box(look(pages["short"]))
    assert rows >= 7 and hidden <= 1 and "more" not in kinds and "wide" not in kinds


def test_a_long_table_scrolls_down_without_a_fade_to_the_right(pages, look):
    kinds, hidden, rows = box(look(pages["long"]))
    assert rows > 15 and hidden > 120 and "more" in kinds and "wide" not in kinds


def test_a_table_wider_than_a_phone_fades_to_the_right(pages, look):
    assert "wide" in box(look(pages["short"], width=390))[0]


def test_a_small_number_of_the_slider_never_reads_0(pages, look):
    page = look(pages["short"])
    told = page.evaluate("[0, 0.126, 0.00153, -0.00066, 12.3, 1, null].map(short)")
    assert told == ["0", "0.13", "0.0015", "-7e-4", "12", "1", ""]
    texts = page.evaluate("document.getElementById('path-reward').data[1].text.flat().filter(one => one !== '')")
    values = page.evaluate("document.getElementById('path-reward').data[1].z.flat().filter(one => one !== null)")
    assert [float(one) == 0 for one in texts] == [one == 0 for one in values]
