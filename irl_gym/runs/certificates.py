"""certificate.json: what a run's reward says of the expert, and what its learner proves of its program, each with its facts.

    {"optimality": {fields, "facts": [...]}, or null where there is no table,
     "proof": {"facts": [...], "terms": {what is read by name}, "own": {what a learner of somebody's own tells, not read}}}
Whoever reads a run recomputes the optimality from the run's table, expert and reward (`verified`), and takes nothing of the
proof for it: which rows a program found unbreakable is its word too, so no row of (4) is left out. The proof is a record.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from irl_gym.facts import Fact, facts_of
from irl_gym.files.metrics_schema import Certificate
from irl_gym.files.run_folder import read_json
from irl_gym.learners.base import Outcome
from irl_gym.mdp.optimality import Optimality, certify
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.sampling_error import ESTIMATED
from irl_gym.tables.tabulation import Tabulation

FREQUENT = Fact("taken for the expert's", "the actions most frequent in its episodes")
LIKELY = Fact("taken for the expert's", "the most likely actions, inferred from the states of its episodes")
ESTIMATE = Fact("judged on", ESTIMATED, "open")


def certificate_of(result: Outcome, known: tuple[Tabulation, Any] | None, *, episodes: bool) -> dict[str, Any]:
    """What certificate.json holds of a result.

    Args:
        result: of any learner.
        known: the table, and the expert as the learner was given it; None where there is no table. Without a reward there is
            nothing to say of the expert.
        episodes: is the expert known by its episodes only? Then it may err.
    """
    proof = result.proved()
    if known is None or result.reward is None:
        return {"optimality": None, "proof": proof}
    table, expert = known
    reward = result.reward.tabular(table.states)
    found = certified(table, expert, reward, episodes=episodes)
    return {"optimality": optimality_told(found, table, inferred=result.inferred is not None), "proof": proof}


def certified(table: Tabulation, expert: Any, reward: TabularReward, *, episodes: bool) -> Optimality:
    """What a run's reward says of its expert.

    Args:
        table: the run's.
        expert: as its learner was given it.
        reward: in the table.
        episodes: is the expert known by its episodes only? Then it may err.

    Raises:
        InvalidPolicy, InvalidReward: what does not belong together.
    """
    return certify(table.mdp, expert, reward, errs=episodes)


def optimality_told(found: Optimality, table: Tabulation, *, inferred: bool) -> dict[str, Any]:
    """The same as json holds it, with what a run knows besides: who is judged, and on which table.

    Args:
        found: what the reward says of the expert.
        table: the run's.
        inferred: were the expert's actions inferred from states?
    """
    more = (LIKELY if inferred else FREQUENT,) if found.errs else ()
    if not table.evidence.exact and found.sampling_error is None:
        more += (ESTIMATE,)
    first, *others = found.facts()
    facts = [one.to_json() for one in (first, *more, *others)]
    return {**found.to_json(), **({"inferred": True} if inferred else {}), "facts": facts}


def read_certificate(path: Path) -> dict[str, Any]:
    """The content of certificate.json.

    Raises:
        DamagedFile: it is something else, such as that of an earlier version.
    """
    told = read_json(path, Certificate)
    facts_in(told)
    return told


def facts_in(certificate: Mapping[str, Any]) -> tuple[tuple[Fact, ...], tuple[Fact, ...]]:
    """The facts of a certificate's optimality, none without a table, and those of its proof.

    Raises:
        DamagedFile: some are no facts.
    """
    parts = (certificate["optimality"] or {"facts": []}, certificate["proof"])
    of_reward, of_program = (facts_of(one.get("facts")) for one in parts)
    return of_reward, of_program


def claims_in(certificate: Mapping[str, Any]) -> dict[str, Any]:
    """All that a certificate says, by name: what a table decides is not a sampling learner's to say."""
    told = {**certificate["proof"]["terms"], **(certificate["optimality"] or {})}
    return {key: one for key, one in told.items() if key != "facts"}
