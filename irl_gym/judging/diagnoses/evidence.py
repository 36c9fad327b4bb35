"""What a question of the doctor may need, and why there may be none of it: then it is not asked, and that is said."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from irl_gym.judging.diagnoses.case import SMALL, Case

EvidenceName = Literal["certificate", "metrics", "expert", "reward", "true", "programs"]
"""The last four take a table, and "programs" one that is small enough to solve some again."""


def lacking(case: Case, needs: Sequence[EvidenceName]) -> str | None:
    """Why the first of some evidence that a case has not is not there, in words; None where all is."""
    told = {
        "certificate": None if case.claims else "there is no proof of a program",
        "metrics": None if case.judged else "no finished run judged it",
        **dict.fromkeys(("expert", "reward", "true", "programs"), "there is no table"),
    }
    if case.mdp is not None:
        unknown = case.gone or "the expert is known in no state in which it acts"
        told |= {
            "expert": None if case.has_expert else unknown,
            "reward": "no reward came out" if case.reward is None else None,
            "true": "the true reward is not known" if case.true is None else None,
            "programs": None if case.small else f"programs are solved again for at most {SMALL:,} reachable states",
        }
    return next((why for one in needs if (why := told[one]) is not None), None)


def too_little(case: Case) -> str | None:
    """Why a reward in which nothing is found cannot be called healthy, in words; None where it can.

    In a table that takes the reward and an expert; without one a certificate by which the expert is best under the reward.
    """
    if case.mdp is not None:
        return lacking(case, ("reward", "expert"))
    if case.claims.get("expert_optimal") is True and not case.claims.get("degenerate"):
        return None
    return "there is no table, and no certificate by which the expert is best under the reward, and not by a tie"


def missed(case: Case, needs: Mapping[Any, Sequence[EvidenceName]]) -> str:
    """How many questions cannot be asked, and why, in a sentence; empty where all can.

    Args:
        case: what is known.
        needs: of each question.
    """
    counts: dict[str, int] = {}
    for one in needs.values():
        if (why := lacking(case, one)) is not None:
            counts[why] = counts.get(why, 0) + 1
    told = "; ".join(f"{count}, as {why}" for why, count in counts.items())
    return f"Not examined, of {len(needs)} questions: {told}." if told else ""
