"""Do the files of a run belong together? Each may be sound by itself, and be of another run, whose table is larger.

Axes: S states, A actions, k pieces of the lambda path.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from irl_gym.judging.diagnoses.plain_words import named_in
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ExpectedAdvantage, ShapedReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.layouts import GridLayout

AGAIN = "delete it, and its stage is run again"
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
            yield f"{name} has shape {found.shape}, but the table asks for ({shape[0]},) or {shape}; {AGAIN}"
    for name, policy in policies.items():
        if policy.ndim == 1 and policy.max(initial=0) >= shape[1]:
            yield f"{name} has action {policy.max()} of {shape[1]}; {AGAIN}"
    if grid is not None and (grid.n_cells > shape[0] or len(grid.directions) != shape[1]):
        cells = f"{grid.n_cells} cells and {len(grid.directions)} actions"
        yield f"grid.json has {cells} for a table of {shape[0]} states and {shape[1]} actions; {AGAIN}"
    named = [pair for one in (diagnosis or {}).get("findings", ()) for pair in named_in(one["sentence"])]
    beyond = [pair for pair in named if pair[0] >= shape[0] or (pair[1] or 0) >= shape[1]]
    if beyond:
        yield f"diagnosis.json speaks of s={beyond[0][0]}, but the table has {shape[0]} states; {AGAIN}"


def left_open(
    shape: tuple[int, int], widths: Mapping[str, np.ndarray] | None, path: Mapping[str, Any] | None
) -> Iterator[str]:  # fmt: skip
    """The same of the two parts of ambiguity.npz.

    Args:
        shape: S and A of the table.
        widths: arrays (S,) or (S, A) by name.
        path: of lambda; arrays by name, and changes, a list.
    """
    if widths is not None:
        kinds = [np.asarray(widths.get(name, ())) for name in WIDTHS]
        odd = [one.shape for one in kinds if one.shape != kinds[0].shape or one.dtype.kind != "f" or np.isinf(one).any()]
        if odd or kinds[0].shape not in (shape, shape[:1]):
            yield f"ambiguity.npz has widths of shape {(odd or [kinds[0].shape])[0]} for {shape[0]} states; {AGAIN}"
    if path is None:
        return
    changes = path.get("changes", [])
    if not isinstance(changes, list) or not all(isinstance(one, dict) for one in changes):
        yield f"ambiguity.npz has changes {changes!r:.60}: expected a list of objects; {AGAIN}"
    k, R = np.size(path.get("l1_norms", ())), np.shape(path.get("rewards", ()))[1:]
    shapes = {"l1_norms": (k,), "breakpoints": (k + 1,), "rewards": (k, *R), "margins": (k, shape[0]), "gap": (), "exact": ()}
    for name, expected in shapes.items():
        one = np.asarray(path.get(name, "nothing"))
        numbers = one.dtype.kind in "fb" and (name == "gap" or not np.isinf(one).any())
        fine = numbers and (name in ("gap", "margins") or not np.isnan(one).any())
        if one.shape != expected or not fine or R not in (shape, shape[:1]):
            yield f"ambiguity.npz has a path with {name} of shape {one.shape} for {shape[0]} states; {AGAIN}"
    if not (np.diff(path["breakpoints"], prepend=0.0) >= 0).all():
        yield f"ambiguity.npz has breakpoints that do not increase from 0; {AGAIN}"


def misshapen(shaped: ShapedReward, learned: TabularReward, mdp: TabularMDP) -> str | None:
    """What is wrong with reward_shaped.npz, likewise; None where it is the shaping of the learned reward on this table."""
    known = shaped.learned.values
    if known.shape != learned.values.shape or not _alike(known, learned.values):
        return f"reward_shaped.npz is of another reward than reward.npz; {AGAIN}"
    now = ExpectedAdvantage(shaped.clip).apply(learned, mdp).values
    if now.shape != shaped.values.shape or not _alike(shaped.values, now):
        return f"reward_shaped.npz has not what reward.npz and table.npz give, the expected advantage; {AGAIN}"
    return None


def _alike(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.abs(one - other).max(initial=0.0) <= WITHIN * np.abs(other).max(initial=0.0))
