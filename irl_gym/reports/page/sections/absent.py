"""Why a section is not on the page: the one place that says so, by what the run lacks and what it recorded of that.

What sections are called is here too, of those that may be absent.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from irl_gym.reports.page.sections.section import Section
from irl_gym.written import sentence_of

REWARDS = ("rewards", "Rewards")
LEARNING = ("learning", "Learning curve")
EPISODES = ("episodes", "Episodes")
LAMBDA = ("lambda", "The price of a large reward")
WIDTHS = ("widths", "What the expert leaves open")
DOCTOR = ("doctor", "Doctor")
TABLE = ("table", "The table")


class Lack(NamedTuple):
    """What is said in place of a section."""

    heading: tuple[str, str]
    """Name and title of the section."""
    sentence: str
    reasons: tuple[str, ...] = ()
    """Where the record of the stage that looks at the reward says why."""
    of_reward: bool = False
    """Is it something of a reward? Where none was learned, the section of rewards says so."""


LACKS: Mapping[str, Lack] = {
    "learned": Lack(
        REWARDS,
        "The learner gives a policy and no reward. So nobody was retrained, and this page has no learned reward, no margins by "
        "which the expert is the best under it, no worst tie, no price of a large reward, no feasible widths and no learning "
        "curve.",
    ),
    "curve": Lack(LEARNING, "No agent was trained step by step, so there is no learning curve.", of_reward=True),
    "films": Lack(EPISODES, "No episode of this run was filmed."),
    "lambda_path": Lack(
        LAMBDA, "How the reward changes with lambda, the price of its norm, was not worked out for this run.",
        ("no_path", "no_ambiguity"), of_reward=True,
    ),
    "widths": Lack(
        WIDTHS, "How wide the feasible set is was not worked out for this run.", ("no_widths", "no_ambiguity"), of_reward=True,
    ),
    "diagnosis": Lack(DOCTOR, "The doctor did not look at this run: an earlier version of irl_gym made it."),
    "told_of_table": Lack(
        TABLE,
        "There is no table: the environment was stepped, and everything is estimated from episodes. So this page has no "
        "values, policies, lambda slider and feasible widths state by state.",
    ),
}  # fmt: skip
"""By what a section needs; what else is not there is not missed, as the section of the table says what goes with it."""


def absent(need: str, stages: Mapping[str, Mapping[str, Any]], rewarded: bool) -> Section | None:
    """In place of a section that needs what is not there; None where nothing is missed.

    Args:
        need: the name of the part.
        stages: the record of each finished stage.
        rewarded: was a reward learned?
    """
    if need not in LACKS or (LACKS[need].of_reward and not rewarded):
        return None
    lack, made = LACKS[need], stages.get("ambiguity", {})
    why = sentence_of(next((made[one] for one in lack.reasons if made.get(one)), None))
    return Section(*lack.heading, f"{lack.sentence} {why}".strip())
