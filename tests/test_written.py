import json

import numpy as np
import pytest

from irl_gym.intervals import as_interval
from irl_gym.reports.page.document import embedded_json
from irl_gym.reports.page.panels import plotted, telling
from irl_gym.written import listed, number, percent, seconds, sentence_of, sum_of, with_ends


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.41464036, "0.4146"), (1.0, "1"), (1234.0, "1,234"), (1234.56, "1,235"), (-0.5, "-0.5"), (0.00012345, "1.23e-04"),
        (None, "not known"), (float("nan"), "not known"), ("auto", "auto"), (0.0, "0"), (99.996, "100"),
    ],
)  # fmt: skip
def test_number_is_short(value, text):
    assert number(value) == text


def test_a_sum_of_rewards_is_0_where_rounding_is_all_that_is_left():
    assert (sum_of(3.8e-11), sum_of(0.25)) == ("0", "0.25")


@pytest.mark.parametrize(
    ("value", "text"), [(0.984, "98.4\u00a0%"), (-1e-9, "0.0\u00a0%"), (-0.5, "-50.0\u00a0%"), (None, "not known")]
)
def test_percent_has_one_decimal(value, text):
    assert percent(value) == text


@pytest.mark.parametrize(("value", "text"), [(0.84, "0.8\u00a0s"), (12.2, "12\u00a0s"), (185.0, "3\u00a0min 05\u00a0s")])
def test_seconds_are_read_at_a_glance(value, text):
    assert seconds(value) == text


def test_interval_has_both_ends():
    assert with_ends(as_interval(0.5, 0.4, 0.6)) == "0.5 (0.4 to 0.6)"
    assert with_ends(as_interval(0.0, None, None)) == "0 (too few to say)"


def test_listed_makes_nan_none_and_shortens():
    assert listed(np.array([[1 / 3, np.nan], [2.0, np.inf]]), 3) == [[0.333, None], [2, None]]


@pytest.mark.parametrize(("text", "told"), [("no pygame", "No pygame."), ("Done.", "Done."), (None, "")])
def test_a_reason_becomes_a_sentence(text, told):
    assert sentence_of(text) == told


def test_embedded_json_cannot_end_its_element():
    text = embedded_json({"a": "</script><!-- &"})
    assert "<" not in text and "&" not in text and json.loads(text) == {"a": "</script><!-- &"}


def test_telling_takes_both_ends_in_order():
    values = np.array([0.0, 5, -3, np.nan, 1, 2])
    assert telling(values).tolist() == [1, 5, 4, 0, 2] and telling(values, 2).tolist() == [1, 2]


def test_plotted_text_is_escaped_and_cut():
    assert plotted("<a href=x>long", 9) == "&lt;a ...ong"
