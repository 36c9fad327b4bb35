"""Does copying the demonstrations do as well: exact values decide where they are known, else the interval of mean returns."""

import pytest

from irl_gym.judging.copied import NEAR, copied, copied_told
from irl_gym.judging.scores import called, in_order, others, scored

EXACT, COUNTED = {"exact": True}, {"exact": False}


def row(score, mean, half=None):
    low, high = (None, None) if half is None else (mean - half, mean + half)
    return {"how": "made", "score": score, "mean_return": mean, "return_low": low, "return_high": high}


def metrics(clone, retrained, table=EXACT, random=(0.0, 0.0), expert=(1.0, 100.0)):
    rows = {"clone": row(*clone), "expert": row(*expert, 1.0), "random": row(*random, 1.0), "retrained": row(*retrained)}
    return {"policies": rows, "table": table}


@pytest.mark.parametrize(
    ("clone", "retrained", "table", "found"),
    [
        ((0.999, 90, 9), (0.995, 95, 9), EXACT, "as well"),
        ((0.995 - NEAR / 2, 95, 9), (0.995, 95, 9), EXACT, "as well"),
        ((0.9, 95, 9), (0.995, 95, 9), EXACT, "worse"),
        ((0.999, 50, 9), (0.995, 95, 9), EXACT, "worse"),  # the value hides what the returns show
        ((0.999, 95, 9), (0.9, 95, 9), COUNTED, "undecided"),
        ((0.2, 95, 1), (0.9, 80, 1), COUNTED, "as well"),
        ((0.9, 60, 9), (0.9, 95, 9), None, "worse"),
        ((0.9, 85, 9), (0.9, 95, 9), None, "undecided"),
        ((0.9, 100, None), (0.9, 100, None), None, "as well"),
        ((None, 100, 1), (None, 80, 1), EXACT, "as well"),
    ],
)  # fmt: skip
def test_a_clone_is_held_against_the_agent(clone, retrained, table, found):
    assert copied(metrics(clone, retrained, table), 200) == found


@pytest.mark.parametrize(("episodes", "found"), [(10, "undecided"), (11, "as well")])
def test_returns_that_agree_are_not_believed_when_they_are_few(episodes, found):
    assert copied(metrics((0.9, 100, None), (0.9, 100, None), None), episodes) == found


def test_it_is_undecided_without_a_score_and_without_a_scale_of_returns():
    assert copied(metrics((None, 0, 1), (None, 0, 1), expert=(None, 0.0)), 200) == "undecided"


@pytest.mark.parametrize(
    ("clone", "words"),
    [
        ((0.999, 90, 9), "does as well here: the clone (made) has a mean return of 90 (81 to 99) and a score of 0.999, "),
        (
            (0.5, 90, 9),
            "does worse here: the clone (made) has a mean return of 90 (81 to 99) and a score of 0.500, ",
        ),
    ],
)
def test_the_sentence_has_the_figures_of_both(clone, words):
    told = copied_told(metrics(clone, (0.995, 95, 9)), 200)
    less = ": 0.495 of score less" if "worse" in words else ""
    assert words in told and told.endswith(f", the retrained agent 95 (86 to 104) and 0.995{less}.")


def test_expected_returns_count_more_than_mean_returns_where_they_are_known():
    told = metrics((0.999, 95, 9), (0.995, 95, 9))
    for name, exact in {"clone": 60.0, "retrained": 95.0, "expert": 100.0, "random": 0.0}.items():
        told["policies"][name]["expected_return"] = exact
    assert copied(told, 200) == "worse" and "has an expected return of 60 and a score of 0.999" in copied_told(told, 200)


def test_what_is_undecided_says_so():
    assert copied_told(metrics((0.9, 85, 9), (0.9, 95, 9), None), 200).startswith("Whether copying the demonstrations does as")


def test_without_a_clone_nothing_is_said_unless_it_failed():
    told = {"policies": {name: row(1, 1) for name in ("expert", "random", "retrained")}, "table": None}
    assert copied(told, 200) is None and copied_told(told, 200) == ""
    assert copied_told({**told, "demonstrations": {"no_clone": "E: why."}}, 200).endswith("to compare with: E: why.")


def test_the_clone_stands_between_the_references_and_what_a_run_is_about():
    rows = metrics((1, 1), (1, 1))["policies"]
    assert [*in_order(rows)] == ["expert", "random", "clone", "retrained"]
    assert (others(rows), scored(rows), called("clone")) == (["retrained"], ["retrained", "clone"], "clone")
