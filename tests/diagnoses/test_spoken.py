"""What the doctor says to who does not write Python."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from irl_gym.diagnoses.spoken import VALUED, WORDS, flags_of, with_names

SCRIPT = Path(__file__).parents[2] / "scripts" / "recover_and_retrain.py"


@pytest.mark.parametrize(
    ("mend", "flags"),
    [
        ('margin_cap="auto" with l1=0.0, and reward_on="state-action" where that leaves them.',
         ("--margin-cap auto", "--l1 0", "--reward-on state-action")),
        ('l1="auto", just below lambda_0, or a number below 12.93; l1=0.0 for the rest.', ("--l1 auto", "--l1 0")),
        ("l1=0.0 first; then raise it slowly.", ("--l1 0",)),
        ('reward_on="state-action" explains it; or slack=10.0, which finds.', ("--reward-on state-action", "--slack 10")),
        ("Nothing, if these are errors: slack=0.5 gives them up.", ("--slack 0.5",)),
        ("FiniteLP() with its defaults: it finds one.", ("--learner finite-lp --l1 0 --margin-cap auto",)),
        ("More or other features; a larger S_0; or FiniteLP.", ("--features", "--learner finite-lp")),
        ("A stronger `inner` planner: more total_timesteps.", ("--inner", "--total-timesteps")),
        ("A larger gamma: at 0.9 it no longer is.", ("--gamma",)),
        ("Read its error.", ()),
    ],
)  # fmt: skip
def test_a_mend_names_its_flags(mend, flags):
    assert flags_of(mend) == flags


def test_a_run_from_a_dataset_is_told_no_flag_for_other_episodes():
    mend = "More episodes; more start_seeds, or an expert with some noise (epsilon)."
    assert flags_of(mend) == ("--episodes", "--start-seeds", "--epsilon") and flags_of(mend, given=True) == ()


def test_every_flag_exists():
    told = subprocess.run([sys.executable, str(SCRIPT), "--help"], capture_output=True, text=True, timeout=120).stdout
    known = set(re.findall(r"--[a-z][-a-z0-9]*", told))
    assert set(re.findall(r"--[a-z][-a-z0-9]*", " ".join([*VALUED.values(), *WORDS.values()]))) <= known


def test_states_and_actions_get_their_names_behind_them():
    told = with_names("It loses in s=13 a=2, s=3 and 4 more; l1=3.", lambda row: f"row {row // 8}, column {row % 8}", "abcd")
    assert told == "It loses in s=13 a=2 (row 1, column 5; c), s=3 (row 0, column 3) and 4 more; l1=3."


def test_states_that_are_bare_numbers_are_not_named_twice():
    assert with_names("s=4, s=5 a=0", lambda row: f"state {row}", ("left",)) == "s=4, s=5 a=0 (left)"
