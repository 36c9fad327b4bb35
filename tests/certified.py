"""What is known of a learned reward, under one roof: what `certify` says of the expert, and what the learner proves."""

from types import SimpleNamespace

from irl_gym.features.linear_reward import LinearReward
from irl_gym.mdp.optimality import certify


def both(result, mdp, expert, states=None):
    """The facts, fields and properties of both, by name; an expert whose violations have a price may err."""
    proof, reward = result.proof, result.reward
    if isinstance(reward, LinearReward):
        reward = reward.tabular(mdp.n_states if states is None else states)
    errs = getattr(proof, "slack", None) is not None
    found = certify(mdp, expert, reward, errs=errs, unbreakable=proof.unbreakable_rows)
    fields = {name: getattr(one, name) for one in (proof, found) for name in one.__dataclass_fields__}
    more = {"degenerate": found.degenerate, "duality_gap": proof.duality_gap, "unbreakable": proof.unbreakable}
    return SimpleNamespace(**fields, **more, tied=found.tied, told=f"{found}\n{proof}")


def certified(learner, mdp, expert, **more):
    """The same of what a learner finds."""
    return both(learner.fit(mdp, expert, **more), mdp, expert, more.get("states"))
