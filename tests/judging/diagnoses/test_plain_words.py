"""What the doctor says to who does not write Python."""

import re
from pathlib import Path

import pytest
import tyro

import irl_gym.judging.diagnoses
from irl_gym.commands.arguments import Arguments
from irl_gym.commands.terminal import OPTIONS
from irl_gym.judging.diagnoses.findings import told_finding
from irl_gym.judging.diagnoses.plain_words import RECORDING, usable_flags, with_names

CHOSEN = {
    "--episodes": "50", "--epsilon": "0.1", "--features": "radial", "--gamma": "0.9", "--l1": "0.5", "--rounds": "9",
    "--total-timesteps": "1000", "--shaping": "", "--steps": "400000", "--expert-normalize": "vecnormalize.pkl",
}  # fmt: skip
"""What a reader may choose for flags that are said without a value."""
SAID = sorted(
    {
        flag
        for file in Path(irl_gym.judging.diagnoses.__path__[0]).glob("*.py")
        for flag in re.findall(r'"(--[^"]*)"', file.read_text())
        if file.name != "plain_words.py"
    }
)
"""Every flag in the source of the checks; {...} stands for a number."""


def typed(flag):
    """A flag as a person types it."""
    number = re.sub(r"\{[^}]*\}", "0.5", flag)
    return [*number.split(), *CHOSEN[flag].split()] if " " not in flag else number.split()


@pytest.mark.parametrize("flag", [*SAID, *(one for one in RECORDING if one != "--expert")])
def test_a_flag_is_one_that_the_loop_takes(flag):
    assert isinstance(tyro.cli(Arguments, args=typed(flag), config=OPTIONS), Arguments)


def test_the_checks_say_flags():
    assert {"--l1 0", "--reward-on state-action", "--episodes", "--slack {10 * slack:g}"} <= set(SAID)


def test_a_run_from_a_dataset_is_told_no_flag_for_other_episodes():
    flags = ("--episodes", "--epsilon", "--expert value-iteration", "--l1 0")
    assert usable_flags(flags) == flags and usable_flags(flags, given=True) == ("--l1 0",)


TIED = {"sentence": "It loses in {where}; l1=3.", "states": [13, *range(3, 8)], "actions": []}


def told(found, actions="abcd"):
    """The sentence of a finding with the names of states on a grid of 8 columns."""
    return told_finding(found, lambda s, a: with_names(s, a, lambda row: f"row {row // 8}, column {row % 8}", actions))


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"states": [13, 3], "actions": [2, 0]}, "s=13 a=2 (row 1, column 5; c), s=3 a=0 (row 0, column 3; a)"),
        ({"states": [13]}, "s=13 (row 1, column 5)"),
    ],
)
def test_states_and_actions_get_their_names_behind_them(changed, where):
    assert told(TIED | changed) == f"It loses in {where}; l1=3."


def test_a_sentence_names_five_states_and_counts_the_others():
    assert told_finding(TIED) == "It loses in s=13, s=3, s=4, s=5, s=6 and 1 more; l1=3."


def test_what_a_sentence_says_of_states_in_words_is_no_state():
    assert told(TIED | {"sentence": "In s=13 a=9, by its own words.", "states": [3]}) == "In s=13 a=9, by its own words."


def test_states_that_are_bare_numbers_are_not_named_twice():
    assert [with_names(4, a, lambda row: f"state {row}", ("left",)) for a in (None, 0)] == ["s=4", "s=4 a=0 (left)"]
