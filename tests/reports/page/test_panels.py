"""Bars: their names stay names, none is cut where it differs, and figures that say so share a scale."""

import numpy as np
import pytest
from reports.page.made_runs import scene_of, table_run

from irl_gym.reports.page.panels import bars, grouped_bars, named
from irl_gym.reports.page.sections.compared import reward_panel, values


@pytest.fixture(scope="module")
def cards(tmp_path_factory):
    return scene_of(table_run(tmp_path_factory.mktemp("cards"), "Blackjack-v1", errors=20, films=False, sab=False))


def drawn(names, **more):
    return bars("a", "A", np.arange(float(len(names))), names, what="x", caption="", unit="x", **more).figure


def test_names_that_are_numbers_stay_names():
    grouped = grouped_bars("a", "A", {"b": np.ones(2)}, ["0", "1"], caption="", unit="x").figure
    for figure in (drawn(["36 (ended)", "0", "1"]), grouped):
        assert figure.to_dict()["layout"]["yaxis"]["type"] == "category"


def test_long_names_differ_in_full():
    names = [f"stick in 20 with an ace against {card}, no natural (ended)" for card in range(2, 10)]
    labels = drawn(names).to_dict()["data"][0]["y"]
    assert [label.replace("<br>", " ") for label in labels] == names


def test_a_name_is_escaped_line_by_line():
    assert named("<b>bold</b> " + "word " * 8).count("<br>") == 1 and "<b>" not in named("<b>bold</b>")


def test_bars_that_are_alike_share_a_scale(cards):
    expert, agent, *_ = values(cards).panels
    spans = [panel.figure.to_dict()["layout"]["xaxis"]["range"] for panel in (expert, agent)]
    shown = np.concatenate([np.array(panel.figure.to_dict()["data"][0]["x"]) for panel in (expert, agent)])
    assert spans[0] == spans[1] and spans[0][0] <= shown.min() and shown.max() <= spans[0][1]


def test_states_in_which_an_episode_has_ended_say_so(cards):
    ended = np.flatnonzero(cards.mdp.reachable & cards.mdp.terminal)
    assert ended.size > 100 and all(name.endswith("(ended)") for name in cards.names(ended))


def test_the_true_reward_of_cards_is_what_they_pay(cards):
    panel = reward_panel("true", "True", cards.table.reward, cards)
    shown = np.array(panel.figure.to_dict()["data"][0]["x"])
    assert shown.min() == -1 and 0.9 < shown.max() < 1 and "from -1 to 0.9" in panel.caption
