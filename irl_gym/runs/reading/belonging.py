"""Do the files of a run belong together? Each may be sound by itself, and be of another run, whose table is larger.

Axes: S states, A actions, k pieces of the lambda path.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from irl_gym.errors import InvalidInput
from irl_gym.judging.scores import CLONE, LEARNED, RETRAINED
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.layouts import GridLayout

MADE_AGAIN = "delete it, and its stage is run again"
WIDTHS = ("low", "high", "width")
WITHIN = 1e-6
"""Share of the largest value by which two computations may differ."""


def strangers(
    shape: tuple[int, int], actions: Sequence[str], rewards: Mapping[str, np.ndarray], policies: Mapping[str, np.ndarray],
    grid: GridLayout | None, diagnosis: Mapping[str, Any] | None,
) -> Iterator[str]:  # fmt: skip
    """What is wrong with files beside a table, each in words that name the file, with the mend.

    Args:
        shape: S and A of the table.
        actions: their names, in environment.json.
        rewards: values by the file's name.
        policies: (S,) actions or (S, A) by the file's name.
        grid: the map.
        diagnosis: the content of diagnosis.json.
    """
    if len(actions) != shape[1]:
        yield f"environment.json names {len(actions)} actions, but the table has {shape[1]}; delete it, and it is written again"
    for name, found in {**rewards, **policies}.items():
        if found.shape not in (shape, shape[:1]):
            yield f"{name} has shape {found.shape}, but the table asks for ({shape[0]},) or {shape}; {MADE_AGAIN}"
    for name, policy in policies.items():
        if policy.ndim == 1 and policy.max(initial=0) >= shape[1]:
            yield f"{name} has action {policy.max()} of {shape[1]}; {MADE_AGAIN}"
        if name != "expert.npz" and policy.ndim == 2 and (unknown := np.isnan(policy).any(axis=1)).any():
            state = int(np.argmax(unknown))
            yield f"{name} says nothing of state {state}, and a policy that is judged acts in all; {MADE_AGAIN}"
    if grid is not None and (grid.n_cells > shape[0] or len(grid.directions) != shape[1]):
        cells = f"{grid.n_cells} cells and {len(grid.directions)} actions"
        yield f"grid.json has {cells} for a table of {shape[0]} states and {shape[1]} actions; {MADE_AGAIN}"
    for found in (diagnosis or {}).get("findings", ()):
        for name, n in (("states", shape[0]), ("actions", shape[1])):
            if (most := max(found[name], default=0)) >= n:
                yield f"diagnosis.json has {most} among the {name} of {found['name']!r:.60}, of {n} in the table; {MADE_AGAIN}"


def at_odds(
    stages: Mapping[str, Mapping[str, Any]], metrics: Mapping[str, Any], certificate: Mapping[str, Any], there: Container[str]
) -> Iterator[str]:
    """Where records do not agree on what there is: a table, a reward, a policy of the learner's own, a clone.

    Args:
        stages: the record of each stage.
        metrics: the content of metrics.json.
        certificate: the content of certificate.json.
        there: the names of files that are.
    """
    learned, copied = stages["reward"], stages.get("clone", {}).get("files")
    rewarded, mend = "reward.npz" in learned["files"], "delete metrics.json, and it is made again"
    for name, what, stage, found in (
        (RETRAINED, "a reward was learned", "reward", rewarded),
        (LEARNED, "a policy was learned", "reward", learned.get("policy", False)),
        (CLONE, "there is a clone", "clone", bool(copied)),
    ):
        if (name in metrics["policies"]) is not found:
            yield f"metrics.json and .stages/{stage}.json do not agree on whether {what}; {mend}"
    if metrics.get("table") is None:
        if "table.npz" in there:
            yield f"metrics.json tells of no table, and table.npz is there; {mend}"
        if certificate["optimality"] is not None:
            what = (
                "certificate.json says whether the expert is optimal, which only a table tells, and metrics.json tells of none"
            )
            yield f"{what}; delete certificate.json and metrics.json, and they are made again"
    if not rewarded and (certificate["optimality"] is not None or "reward.npz" in there):
        what = "no agent was retrained, but certificate.json or reward.npz is of a reward"
        yield f"{what}; delete certificate.json and metrics.json, and they are made again"


def left_open(
    shape: tuple[int, int], widths: Mapping[str, np.ndarray] | None, path: Mapping[str, Any] | None
) -> Iterator[str]:  # fmt: skip
    """The same of the two parts of ambiguity.npz.

    Args:
        shape: S and A of the table.
        widths: arrays (S,) or (S, A) by name.
        path: of lambda; arrays by name.
    """
    if widths is not None:
        kinds = [np.asarray(widths.get(name, ())) for name in WIDTHS]
        odd = [one.shape for one in kinds if one.shape != kinds[0].shape or one.dtype.kind != "f" or np.isinf(one).any()]
        if odd or kinds[0].shape not in (shape, shape[:1]):
            yield f"ambiguity.npz has widths of shape {(odd or [kinds[0].shape])[0]} for {shape[0]} states; {MADE_AGAIN}"
    if path is None:
        return
    k, R = np.size(path.get("l1_norms", ())), np.shape(path.get("rewards", ()))[1:]
    shapes = {"l1_norms": (k,), "breakpoints": (k + 1,), "rewards": (k, *R), "margins": (k, shape[0]), "total_margins": (k,)}
    shapes |= dict.fromkeys(("gap", "exact", "r_max", "margin_cap"), ())
    for name, expected in shapes.items():
        one = np.asarray(path.get(name, "nothing"))
        numbers = one.dtype.kind in "fb" and (name == "gap" or not np.isinf(one).any())
        fine = numbers and (name in ("gap", "margins", "margin_cap") or not np.isnan(one).any())
        if one.shape != expected or not fine or R not in (shape, shape[:1]):
            yield f"ambiguity.npz has a path with {name} of shape {one.shape} for {shape[0]} states; {MADE_AGAIN}"
    r_max, cap = (float(path[name]) for name in ("r_max", "margin_cap"))
    if r_max <= 0 or cap <= 0:
        yield f"ambiguity.npz has a path with r_max {r_max:g} and margin_cap {cap:g}: expected both above 0; {MADE_AGAIN}"
    if not (np.diff(path["breakpoints"], prepend=0.0) >= 0).all():
        yield f"ambiguity.npz has breakpoints that do not increase from 0; {MADE_AGAIN}"


def misshapen(shaped: ShapedReward, learned: TabularReward, mdp: TabularMDP, margin_cap: float | None) -> str | None:
    """What is wrong with reward_shaped.npz, likewise; None where it is the shaping of the learned reward on this table.

    Args:
        shaped: what the file holds.
        learned: the reward, in the table.
        mdp: the table.
        margin_cap: of the learner's program, up to which losses count; None or 0 for a typical loss.
    """
    known = shaped.learned.values
    if known.shape != learned.values.shape or not _alike(known, learned.values):
        return f"reward_shaped.npz is of another reward than reward.npz; {MADE_AGAIN}"
    try:
        now = ShapedReward.of(learned, mdp, margin_cap or None)
    except InvalidInput as error:
        return f"certificate.json has the margin_cap {margin_cap}, and no reward can be clipped there ({error}); {MADE_AGAIN}"
    if (shaped.clip is None) is not (now.clip is None) or not _alike(np.float64(shaped.clip or 0), np.float64(now.clip or 0)):
        return f"reward_shaped.npz counts losses up to {shaped.clip}: expected {now.clip}, as the run has it; {MADE_AGAIN}"
    if now.values.shape != shaped.values.shape or not _alike(shaped.values, now.values):
        return f"reward_shaped.npz has not what reward.npz and table.npz give, the expected advantage; {MADE_AGAIN}"
    return None


def _alike(one: Any, other: Any) -> bool:
    return bool(np.abs(one - other).max(initial=0.0) <= WITHIN * np.abs(other).max(initial=0.0))
