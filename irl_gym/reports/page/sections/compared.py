"""Rewards, values and policies side by side: what is true, and what was learned. Axes: S states, A actions."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from irl_gym._typing import Indices, Matrix, StateMask, Vector
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.scores import LEARNED, RETRAINED, called
from irl_gym.mdp.arrival_rewards import paid_on_arrival
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page import maps, panels
from irl_gym.reports.page.panels import Panel, bars, spread, telling
from irl_gym.reports.page.scene import Scene, chosen
from irl_gym.reports.page.sections.absent import REWARDS
from irl_gym.reports.page.sections.goodness import not_goodness
from irl_gym.reports.page.sections.section import Section
from irl_gym.written import aligned, counted, number, percent

MOST_ROWS = 40
"""Rows of the table of states in which the agent deviates."""
FEW = 4
"""Payments of different sizes that are counted one by one."""
ANCHORS = {RETRAINED: "agent", LEARNED: "own"}
"""What figures of judged policies end in."""


def rewards(
    learned: TabularReward | LinearReward, scene: Scene | None, metrics: Mapping[str, Any], recomputed: bool
) -> Section:
    """The environment's reward beside the learned one, each on its own scale; without a table, what that is made of."""
    if scene is None or scene.learned is None:
        return weights(learned)
    made = [
        reward_panel(f"reward-{name}", f"{title} reward", paid, scene)
        for name, title, paid in (("true", "True", scene.table.reward), ("learned", "Learned", scene.learned))
    ]
    lead = (
        "What the environment pays, which the learner never saw, beside what was recovered from the expert. Each has its own "
        "scale: many rewards make the same actions best, so the two need not look alike."
    )
    if metrics["reward"].get("expert_optimal") and not metrics["reward"].get("degenerate"):
        lead += not_goodness(scene, scene.learned, "" if recomputed else ", by the run's own record")
    return Section(*REWARDS, lead, made)


def weights(weights: TabularReward | LinearReward) -> Section:
    """What a reward that is not known state by state is made of."""
    lead = "This environment was stepped, not tabulated, so there is no true reward state by state to compare with. "
    if weights.alpha is None:
        return Section(*REWARDS, lead)
    alpha, features = weights.alpha, weights.features
    order = telling(alpha)
    centres = getattr(features, "centres", None)
    where = [_at(centres, int(i)) for i in order]
    caption = (
        f"Weights of the {type(features).__name__} features, {spread(alpha)}; {int((alpha != 0).sum())} of {alpha.size} are "
        "not 0. " + _left_out(order.size, alpha.size, "features")
    )
    panel = bars("weights", "Weights of the learned reward", alpha[order], where, what="weight", caption=caption, unit="weight")
    return Section(*REWARDS, lead + "The learned reward is a weighted sum of features.", [panel])


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
    """Values of expert and judged policies under the true reward, on one scale; the expert's under the learned one."""
    seen = "" if scene.seen[scene.acting].all() else " Left out are states in which the expert was not seen."
    expert = scene.value(scene.table.reward, scene.expert)
    expert[~scene.seen] = np.nan
    true = {"value-expert": ("Expert, true reward", expert, seen)}
    for name, policy in scene.agents.items():
        true[f"value-{ANCHORS[name]}"] = f"{_title(name)}, true reward", scene.value(scene.table.reward, policy), ""
    alike = np.concatenate([one for _, one, _ in true.values()])
    made = [_value(name, title, V, scene, f"{spread(V)}.{more}", alike) for name, (title, V, more) in true.items()]
    told = "Expected discounted reward from each state on"
    where = f"where they differ is where {_agent(scene)} falls behind"
    if scene.learned is None:
        return Section("values", "Values", f"{told}, on one scale: {where}.", made)
    first = "two" if len(true) == 2 else "three"
    lead = f"{told}. The first {first} have one scale, so {where}."
    learned = scene.value(scene.learned, scene.expert)
    learned[~scene.seen] = np.nan
    unit = f"{spread(learned)}, in the learned reward's unit.{seen}"
    made.append(_value("value-learned", "Expert, learned reward", learned, scene, unit))
    if scene.place is None:
        judged = scene.acting & scene.seen
        made.append(
            panels.dots(
                "value-both", "Each state under both rewards", expert[judged], learned[judged],
                scene.names(np.flatnonzero(judged)), labels=("expert's value, true reward", "expert's value, learned reward"),
                caption="A point for each state in which the expert acts. Where the cloud rises, the learned reward ranks "
                f"states as the true one does. {_ranked(expert[judged], learned[judged])}",
            )
        )  # fmt: skip
    return Section("values", "Values", lead, made)


def _title(name: str) -> str:
    """What a judged policy is called above its figure."""
    return f"{called(name)[0].upper()}{called(name)[1:]}"


def _agent(scene: Scene) -> str:
    """What is spoken of where all judged policies are meant."""
    return f"the {called(next(iter(scene.agents)))}" if len(scene.agents) == 1 else "a policy"


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
    """The expert's actions beside those of each judged policy, and where it deviates."""
    off = {name: np.flatnonzero(scene.deviates(policy)) for name, policy in scene.agents.items()}
    told = " ".join(_agrees(scene, name, int(rows.size)) for name, rows in off.items())
    where = "the cell is shaded and the action listed below" if scene.place is not None else "the action is listed below"
    lead = f"{told} Where it does not, {where}." if any(rows.size for rows in off.values()) else told
    tables = [_deviations(scene, name, rows) for name, rows in off.items() if rows.size]
    return Section("policies", "Policies", lead, list(policy_panels(scene)), "policies", {"tables": tables})


def _agrees(scene: Scene, name: str, off: int) -> str:
    """In how many states a judged policy does what is good, or would most likely do it."""
    judged, policy = scene.acting, scene.agents[name]
    n = int(judged.sum())
    good = "an optimal action" if (scene.good == scene.optimal)[judged].all() else "one of the expert's actions"
    does = "takes" if _certain(policy) else "most likely takes"
    return f"In {n - off:,} of {counted(n, 'state')} ({percent((n - off) / max(n, 1))}) the {called(name)} {does} {good}."


def _certain(policy: Matrix) -> bool:
    """Has a policy (S, A) one action in each state?"""
    return bool((policy.max(axis=1) == 1).all())


def _deviations(scene: Scene, name: str, rows: Indices) -> dict[str, object]:
    """The table of states (n,) in which a judged policy deviates, the costliest first."""
    policy = scene.agents[name]
    lost, behind = scene.lost(policy), scene.behind(policy)
    rows = rows[np.argsort(-lost[rows], kind="stable")]
    most = rows[:MOST_ROWS]
    told = [
        {**_deviation(scene, policy, int(row)), "lost": once, "behind": after}
        for row, once, after in zip(most, aligned(lost[most]), aligned(behind[most]), strict=True)
    ]
    return {"who": called(name), "rows": told, "left": int(rows.size - most.size)}


def _deviation(scene: Scene, policy: Matrix, row: int) -> dict[str, str]:
    def told(actions: np.ndarray) -> str:
        return " or ".join(scene.actions[a] for a in np.flatnonzero(actions))

    return {
        "state": scene.name(int(row)),
        "expert": told(chosen(scene.expert)[row]) if scene.seen[row] else "not seen",
        "optimal": told(scene.optimal[row]),
        "agent": scene.actions[int(policy[row].argmax())],
    }


def policy_panels(scene: Scene) -> list[Panel]:
    """The actions of the expert and of each judged policy on the map; elsewhere counts of all."""
    acting, place = scene.acting, scene.place
    known = acting & scene.seen
    sides = [("policy-expert", "Expert", scene.expert, known)]
    sides += [(f"policy-{ANCHORS[name]}", _title(name), policy, acting) for name, policy in scene.agents.items()]
    if place is None:
        counts = {title: (chosen(policy) & shown[:, None]).sum(axis=0) for _, title, policy, shown in sides}
        told = "In how many states each takes an action; a state with several counts for each of them."
        return [
            panels.grouped_bars(
                "policy-counts", "Actions taken", counts, scene.actions, caption=told, unit="states in which it is taken"
            )
        ]
    if not place.arrows:
        return [
            maps.choices(
                name, title, place, np.where(shown, policy.argmax(axis=1), np.nan), scene.actions,
                caption=_actions_told(scene, name, policy, shown),
            )
            for name, title, policy, shown in sides
        ]  # fmt: skip
    return [
        maps.arrows(
            name, title, place, chosen(policy), caption=_actions_told(scene, name, policy, shown), shown=shown,
            wrong=None if name == "policy-expert" else scene.deviates(policy),
        )
        for name, title, policy, shown in sides
    ]  # fmt: skip


def _actions_told(scene: Scene, name: str, policy: Matrix, shown: StateMask) -> str:
    """What the map of a policy's actions shows."""
    several = " Several arrows: several actions." if (chosen(policy)[shown].sum(axis=1) > 1).any() else ""
    if name == "policy-expert":
        return f"The expert's action in each of {counted(int(shown.sum()), 'state')}.{several}"
    own = "The agent's action." if _certain(policy) else f"Its likeliest action, and those at least half as likely.{several}"
    return f"{own} Shaded: {counted(int(scene.deviates(policy).sum()), 'state')} where it deviates."
