"""Demonstrations from NumPy arrays and lists: an array an episode, one long array, or padded ones.

Axes: N episodes, T steps, n rows of all episodes one after the other.
"""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations.choices import Last
from irl_gym.demonstrations.imports.cutting import FLAGS, counts_of, cut, depth, from_lists, from_padded, offsets_at, offsets_of
from irl_gym.demonstrations.imports.members import members
from irl_gym.demonstrations.imports.reading import Reading, reading
from irl_gym.demonstrations.imports.values import as_array, first_part, is_list, numbers
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode
from irl_gym.spaces.batches import batch_size


def from_arrays(
    observations: Any,
    actions: Any,
    *,
    rewards: Any = None,
    terminated: Any = None,
    truncated: Any = None,
    next_observations: Any = None,
    ends: Any = None,
    lengths: Any = None,
    episode: Any = None,
    last: Last = "keep",
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> list[Episode]:
    """Episodes from arrays in one of three layouts; every row is checked before any episode is made.

    *An array an episode*, of any lengths: `actions[i]` is (T_i,) and `observations[i]` holds T_i + 1 or T_i of them.

        from_arrays([[0, 4, 8], [0, 1]], [[1, 1], [2]], terminated=[True, False], env=env)
        from_arrays([[0, 4, 8], [0, 1]], None, env=env)     # of the states alone

    *One long array*: `actions` is (n,), `observations` holds n or n + N, and one of `ends` ((n,) booleans, true in the last
    step of an episode), `lengths` ((N,) steps) or `episode` ((n,) ids, equal within an episode) says where to cut. Without
    these, `terminated` and `truncated` ((n,) booleans) say it.

        from_arrays(observations, actions, ends=terminated | truncated, terminated=terminated, env=env)

    *Padded*: `actions` is (N, T) and `observations` (N, T + 1, ...) or (N, T, ...); `lengths` says how many steps count, and
    what is beyond is not read.

    *States alone*: `actions` is None, and `observations` an array an episode, with T_i + 1 of them; or one long array of n + N,
    with `lengths` (steps), `ends` (true in the last observation of an episode) or `episode` (of each observation).

    Args:
        observations: members of the space; for a Tuple or Dict space lists of them, or a tuple or dictionary of arrays.
        actions: whole numbers; None where only the states are known.
        rewards: laid out like `actions`; 0.0 where they are not known: no learner reads them, and a report pays the
            expert of such a dataset by the table.
        terminated: did the environment end it? One boolean, (N,) booleans, or laid out like `actions`.
        truncated: did a time limit? An episode that is neither counts as truncated: its log stops.
        next_observations: laid out like `actions`; what each step led to.
        ends: true in the last step of each episode.
        lengths: steps of each episode.
        episode: id of each row's episode.
        last: what to do where the last observation is missing: "keep" the last action, whose successor is then not known,
            "drop" it, "repeat" the last observation, or "row", the last row is an observation only; see
            `irl_gym.demonstrations.imports.rows`. Not read where it is there.
        space: of the observations.
        n_actions: A; the actions count from 0.
        action_space: Discrete; the actions count from its start.
        env: has both spaces.

    Raises:
        InvalidDemonstrations: rows that cannot be right; the first is named, counted from 0.
        InvalidParameter: spaces that are missing, or two ways to cut.
        NotDiscrete: continuous actions.
    """
    how = reading(space, n_actions, action_space, env, last)
    columns = {"observations": observations, "actions": actions, "rewards": rewards}
    columns |= {"terminated": terminated, "truncated": truncated, "next_observations": next_observations}
    cuts = {"ends": ends, "lengths": lengths, "episode": episode}
    return episodes_of(how, columns, {key: value for key, value in cuts.items() if value is not None})


def episodes_of(how: Reading, columns: dict[str, Any], cuts: Mapping[str, Any]) -> list[Episode]:
    """Episodes from columns in one of the layouts of `from_arrays`.

    Args:
        how: what they are checked against.
        columns: as `irl_gym.demonstrations.imports.cutting` has them.
        cuts: ends, lengths or episode, or nothing.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
        InvalidParameter: two ways to cut.
    """
    parted = ("observations", "next_observations") if isinstance(how.space, spaces.Tuple) else ()  # there a tuple is of parts
    columns = {key: list(one) if isinstance(one, tuple) and key not in parted else one for key, one in columns.items()}
    if len(cuts) > 1:
        raise InvalidParameter(f"{' and '.join(cuts)} are both given: expected one of them. Leave the other out.")
    actions = columns["actions"]
    if actions is None:
        return _states_alone(how, columns, cuts)
    if not is_list(actions):
        raise InvalidDemonstrations(f"the actions are {type(actions).__name__}: expected an array, or a list of arrays.")
    if len(actions) == 0:
        raise InvalidDemonstrations("there are no rows: expected at least one step.")
    if isinstance(actions, np.ndarray) and actions.shape[1:] == (1,) and len(actions) > 1 and not cuts:
        columns["actions"] = actions = _of_column(how.space, columns["observations"], actions)
    if isinstance(actions, np.ndarray) and actions.ndim == 2 and not {"ends", "episode"} & set(cuts):
        counts = counts_of(cuts["lengths"]) if cuts else np.full(len(actions), actions.shape[1])
        if len(counts) == len(actions):
            return from_padded(how, columns, counts)
    if not cuts and depth(actions) > 1:
        return from_lists(how, columns)
    if not cuts:
        cuts = {key: columns[key] for key in FLAGS if columns.get(key) is not None}
    return cut(how, columns, _offsets(len(actions), cuts), _row_from_0)


def _states_alone(how: Reading, columns: dict[str, Any], cuts: Mapping[str, Any]) -> list[Episode]:
    """Episodes without actions; arguments and errors as `episodes_of`."""
    if not is_list(first_part(columns["observations"])) or not len(first_part(columns["observations"])):
        raise InvalidDemonstrations("there are no rows: expected at least two observations of an episode.")
    if not cuts:
        return from_lists(how, columns)
    rows = batch_size(members(how.space, columns["observations"], "observation", _row_from_0))
    if "lengths" not in cuts:
        return cut(how, columns, _offsets(rows, cuts), _row_from_0)
    counts = counts_of(cuts["lengths"])
    if counts.sum() + counts.size != rows:
        raise InvalidDemonstrations(
            f"the lengths add up to {counts.sum()} steps in {counts.size} episodes, of {rows} observations: expected "
            f"{counts.sum() + counts.size}, one more than steps in each. Give the steps of each episode."
        )
    return cut(how, columns, offsets_of(counts))


def _row_from_0(row: int) -> str:
    return f"row {row} (from 0)"


def _of_column(space: spaces.Space, observations: Any, actions: np.ndarray) -> np.ndarray:
    """Actions (n, 1) as (n,) where the observations beside them are one long array, and as they are where they are padded.

    Raises:
        InvalidDemonstrations: nothing tells a column of n steps from n episodes of a step.
    """
    n, part = len(actions), np.shape(as_array(first_part(observations), "observations"))
    while isinstance(space, spaces.Tuple | spaces.Dict):
        space = next(iter(space.values() if isinstance(space, spaces.Dict) else space))
    shape = space.shape or ()
    if part == (n, 1, *shape):
        raise InvalidDemonstrations(
            f"the actions have shape ({n}, 1) and the observations {part}: expected to know whether these are {n} steps or {n} "
            f"episodes of a step. Give actions[:, 0] for steps, or lengths=[1] * {n} for episodes."
        )
    return actions[:, 0] if part == (n, *shape) else actions


def _offsets(n: int, cuts: Mapping[str, Any]) -> np.ndarray:
    """(N + 1,) where the episodes of n rows start, and n; `cuts` is one of the three, or the flags."""
    if "lengths" in cuts:
        offsets = offsets_of(counts_of(cuts["lengths"]))
        if offsets[-1] != n:
            raise InvalidDemonstrations(f"the lengths add up to {offsets[-1]}: expected {n}, the number of actions.")
        return offsets
    if "episode" in cuts:
        return _offsets_of_ids(n, as_array(cuts["episode"], "episode ids"))
    ends = [numbers(one, "end", _row_from_0) for one in cuts.values()]
    if not ends or any(one.shape != (n,) for one in ends):
        shapes = " and ".join(str(one.shape) for one in ends) or "not given"
        raise InvalidDemonstrations(
            f"the ends of the episodes are {shapes} for {n} actions in one array: expected ends, lengths or episode. Write "
            "[actions] and [observations] if it is one episode."
        )
    return offsets_at(np.any(ends, axis=0))


def _offsets_of_ids(n: int, ids: np.ndarray) -> np.ndarray:
    if ids.shape != (n,):
        raise InvalidDemonstrations(f"the episode ids have shape {ids.shape}: expected ({n},), one an action.")
    offsets = offsets_at(np.append(ids[1:] != ids[:-1], True))
    seen = set()
    for row in offsets[:-1].tolist():
        one = ids[row : row + 1].tolist()[0]
        if one in seen:
            raise InvalidDemonstrations(
                f"row {row} (from 0) goes back to episode {one!r}: expected its rows one after the other. Sort them."
            )
        seen.add(one)
    return offsets
