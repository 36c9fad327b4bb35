"""Rewards, values and policies side by side: what is true, and what was learned. Axes: S states, A actions."""

import numpy as np
from scipy.stats import spearmanr

from irl_gym._typing import Indices, StateMask, Vector
from irl_gym.features.linear_reward import LinearReward
from irl_gym.mdp.arrival_rewards import paid_on_arrival
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page import maps, panels
from irl_gym.reports.page.panels import Panel, bars, spread, telling
from irl_gym.reports.page.scene import Scene, chosen
from irl_gym.reports.page.sections.section import Section
from irl_gym.written import aligned, counted, number, percent

MOST_ROWS = 40
"""Rows of the table of states in which the agent deviates."""
FEW = 4
"""Payments of different sizes that are counted one by one."""


def rewards(scene: Scene) -> Section:
    """The environment's reward beside the learned one, each on its own scale."""
    made = [
        reward_panel(f"reward-{name}", f"{title} reward", paid, scene)
        for name, title, paid in (("true", "True", scene.table.reward), ("learned", "Learned", scene.learned))
    ]
    lead = (
        "What the environment pays, which the learner never saw, beside what was recovered from the expert. Each has its own "
        "scale: many rewards make the same actions best, so the two need not look alike."
    )
    return Section("rewards", "Rewards", lead, made)


def weights(weights: TabularReward | LinearReward) -> Section:
    """What a reward that is not known state by state is made of."""
    lead = "This environment was stepped, not tabulated, so there is no true reward state by state to compare with. "
    if weights.alpha is None:
        return Section("rewards", "Rewards", lead)
    alpha, features = weights.alpha, weights.features
    order = telling(alpha)
    centres = getattr(features, "centres", None)
    where = [_at(centres, int(i)) for i in order]
    caption = (
        f"Weights of the {type(features).__name__} features, {spread(alpha)}; {int((alpha != 0).sum())} of {alpha.size} are "
        "not 0. " + _left_out(order.size, alpha.size, "features")
    )
    panel = bars("weights", "Weights of the learned reward", alpha[order], where, what="weight", caption=caption, unit="weight")
    return Section("rewards", "Rewards", lead + "The learned reward is a weighted sum of features.", [panel])


def _at(centres: np.ndarray | None, i: int) -> str:
    return f"feature {i}" if centres is None else f"{i}: ({', '.join(f'{one:.2g}' for one in centres[i])})"


def _left_out(drawn: int, of: int, what: str) -> str:
    return "" if drawn >= of else f"Drawn are the {drawn} of {of:,} {what} that are largest and smallest."


def reward_panel(name: str, title: str, reward: TabularReward, scene: Scene) -> Panel:
    """A reward on a map, or as sorted bars."""
    table = scene.mdp
    R = reward.values
    if R.ndim == 2 and (found := paid_on_arrival(R, table)) is not None:
        R = found
    if R.ndim == 1:
        told = f"Paid on arrival in a state, {spread(R[table.reachable])}."
        return of_states(name, title, R, scene, told, scale=panels.REWARDS, centred=True, shown=table.reachable)
    acting = scene.acting
    told = f"Paid for a step, by state and action, {_counts(R[acting])}."
    if scene.place is not None and maps.has_crosses(scene.place):
        told += " Each cell has one field for each move."
        if not scene.place.layout.directions.any(axis=1).all():
            told += " The one in its middle is for staying."
        return maps.crosses(name, title, scene.place, R, scene.actions, caption=told, shown=acting)
    if scene.place is not None:
        told += " Drawn is the largest over actions."
        return maps.heat(
            name, title, scene.place, R.max(axis=1), scale=panels.REWARDS, centred=True, caption=told, shown=acting
        )
    rows = np.flatnonzero(np.repeat(acting, table.n_actions))
    order = rows[telling(R.ravel()[rows])]
    names = [f"{scene.actions[a]} in {scene.name(int(s))}" for s, a in zip(*np.divmod(order, table.n_actions), strict=True)]
    told += f" {_left_out(order.size, rows.size, 'steps')}"
    return bars(name, title, R.ravel()[order], names, what="reward", caption=told, unit="reward of a step")


def _counts(values: np.ndarray) -> str:
    """Which numbers there are, and how often, where they are few; else the least and the largest."""
    found, times = np.unique(np.round(values, 9), return_counts=True)
    if found.size > FEW:
        return spread(values)
    return ", ".join(f"{number(one)} in {counted(int(n), 'step')}" for one, n in zip(found, times, strict=True))


def of_states(
    name: str, title: str, values: Vector, scene: Scene, caption: str, *, scale: str, centred: bool, shown: StateMask,
    unit: str = "reward", alike: np.ndarray | None = None,
) -> Panel:  # fmt: skip
    """Values (S,) on the map, or as sorted bars of the states that tell most."""
    if scene.place is not None:
        return maps.heat(
            name, title, scene.place, values, scale=scale, centred=centred, caption=caption, shown=shown, alike=alike
        )
    rows = np.flatnonzero(shown & np.isfinite(values))
    order = rows[telling(values[rows])]
    caption = f"{caption} {_left_out(order.size, rows.size, 'states')}"
    return bars(name, title, values[order], scene.names(order), what=unit, caption=caption, unit=unit, alike=alike)


def values(scene: Scene) -> Section:
    """The expert's and the agent's value, under the true reward on one scale, and the expert's under the learned reward."""
    true = {
        "value-expert": ("Expert, true reward", scene.value(scene.table.reward, scene.expert)),
        "value-agent": ("Retrained agent, true reward", scene.value(scene.table.reward, scene.agent)),
    }
    learned = scene.value(scene.learned, scene.expert)
    for one in (true["value-expert"][1], learned):
        one[~scene.seen] = np.nan
    alike = np.concatenate([one for _, one in true.values()])
    seen = "" if scene.seen[scene.acting].all() else " Left out are states in which the expert was not seen."
    made = [
        _value(name, title, V, scene, f"{spread(V)}.{seen if name == 'value-expert' else ''}", alike)
        for name, (title, V) in true.items()
    ]
    made.append(
        _value(
            "value-learned", "Expert, learned reward", learned, scene, f"{spread(learned)}, in the learned reward's unit.{seen}"
        )
    )
    lead = (
        "Expected discounted reward from each state on. The first two have one scale, so where they differ is where the agent "
        "falls behind."
    )
    if scene.place is None:
        judged = scene.acting & scene.seen
        made.append(
            panels.dots(
                "value-both", "Each state under both rewards", true["value-expert"][1][judged], learned[judged],
                scene.names(np.flatnonzero(judged)), labels=("expert's value, true reward", "expert's value, learned reward"),
                caption="A point for each state in which the expert acts. Where the cloud rises, the learned reward ranks "
                f"states as the true one does. {_ranked(true['value-expert'][1][judged], learned[judged])}",
            )
        )  # fmt: skip
    return Section("values", "Values", lead, made)


def _ranked(true: Vector, learned: Vector) -> str:
    """How far two values (n,) put states in one order."""
    if min(np.ptp(true), np.ptp(learned)) <= 0:
        return "One of the two values is the same everywhere, so there is no order to compare."
    return f"Rank correlation: {float(np.asarray(spearmanr(true, learned))[0]):.2f}, where 1 is the same order and 0 none."


def _value(name: str, title: str, V: Vector, scene: Scene, told: str, alike: np.ndarray | None = None) -> Panel:
    caption = f"Discounted value {told}"
    return of_states(
        name,
        title,
        V,
        scene,
        caption,
        scale=panels.VALUES,
        centred=False,
        shown=scene.acting,
        unit="discounted value",
        alike=alike,
    )


def policies(scene: Scene) -> Section:
    """The expert's actions beside the agent's, and where the agent deviates."""
    off, judged = scene.deviates, scene.acting
    right = int((judged & ~off).sum())
    share = percent(right / max(int(judged.sum()), 1))
    of = counted(int(judged.sum()), "state")
    good = "an optimal action" if (scene.good == scene.optimal)[judged].all() else "one of the expert's actions"
    told = f"In {right:,} of {of} ({share}) the agent takes {good}."
    where = "the cell is shaded and the action listed below" if scene.place is not None else "the action is listed below"
    lead = f"{told} Where it does not, {where}." if off.any() else told
    rows = np.flatnonzero(off)
    rows = rows[np.argsort(-scene.lost[rows], kind="stable")]
    shown = {
        "deviations": _deviations(scene, rows[:MOST_ROWS]),
        "left": max(rows.size - MOST_ROWS, 0),
    }
    return Section("policies", "Policies", lead, list(policy_panels(scene)), "policies", shown)


def _deviations(scene: Scene, rows: Indices) -> list[dict[str, str]]:
    """The table of states (n,) in which the agent deviates."""
    lost, behind = aligned(scene.lost[rows]), aligned(scene.behind[rows])
    return [
        {**_deviation(scene, int(row)), "lost": once, "behind": after}
        for row, once, after in zip(rows, lost, behind, strict=True)
    ]


def _deviation(scene: Scene, row: int) -> dict[str, str]:
    def told(actions: np.ndarray) -> str:
        return " or ".join(scene.actions[a] for a in np.flatnonzero(actions))

    return {
        "state": scene.name(int(row)),
        "expert": told(chosen(scene.expert)[row]) if scene.seen[row] else "not seen",
        "optimal": told(scene.optimal[row]),
        "agent": scene.actions[int(scene.agent[row].argmax())],
    }


def policy_panels(scene: Scene) -> list[Panel]:
    """The expert's and the agent's actions on the map; elsewhere counts of both."""
    acting, place = scene.acting, scene.place
    known = acting & scene.seen
    sides = (("policy-expert", "Expert", scene.expert, known), ("policy-agent", "Retrained agent", scene.agent, acting))
    if place is None:
        counts = {title: (chosen(policy) & shown[:, None]).sum(axis=0) for _, title, policy, shown in sides}
        told = "In how many states each takes an action; a state with several counts for each of them."
        return [
            panels.grouped_bars(
                "policy-counts", "Actions taken", counts, scene.actions, caption=told, unit="states in which it is taken"
            )
        ]
    several = " Several arrows: several actions." if (chosen(scene.expert)[known].sum(axis=1) > 1).any() else ""
    captions = {
        "policy-expert": f"The expert's action in each of {counted(int(known.sum()), 'state')}.{several}",
        "policy-agent": f"The agent's action. Shaded: {counted(int(scene.deviates.sum()), 'state')} where it deviates.",
    }
    if not place.arrows:
        return [
            maps.choices(
                name, title, place, np.where(shown, policy.argmax(axis=1), np.nan), scene.actions, caption=captions[name]
            )
            for name, title, policy, shown in sides
        ]
    return [
        maps.arrows(
            name, title, place, chosen(policy), caption=captions[name], shown=shown,
            wrong=scene.deviates if name == "policy-agent" else None,
        )
        for name, title, policy, shown in sides
    ]  # fmt: skip
