"""Tables as files: an npz of numbers, and the evidence as json; nothing in it is ever unpickled.

The observation space is not kept: who reads the file gives it, and it is compared.
"""

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeGuard, get_args, get_type_hints

import numpy as np
from gymnasium import spaces

from irl_gym.checks import checked_csr
from irl_gym.errors import DamagedFile, InvalidInput, InvalidMDP, InvalidParameter, NotDiscrete
from irl_gym.files.archives import json_in, read_arrays
from irl_gym.files.own_files import write_arrays
from irl_gym.mdp.rewards import TabularReward, plain_json
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.spaces.coordinates import CircularCoordinates, Coordinates, IntegerCoordinate
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.cells import Cells
from irl_gym.tables.repeats import Repeats
from irl_gym.tables.selfcheck import Payments, SelfCheck
from irl_gym.tables.tabulation import Evidence, Tabulation

TABLE = "table.npz"
"""The table in the folder of a run."""
PARTS = {
    "data": "f", "indices": "iu", "indptr": "iu", "d0": "f", "gamma": "f", "reward": "f", "mean": "f", "deviation": "f",
    "entries": "f", "largest": "f", "space": "U", "numbers": "fiu", "copies": "iu", "evidence": "U",
}  # fmt: skip
"""The arrays of a table and the kinds of their dtype; `numbers` that are not there are an empty array of floats."""
_FOUND: dict[str, Any] = {"check": SelfCheck, "repeats": Repeats}
"""The parts of the evidence that are records of their own."""
UNDER_WAY = ".enumeration.tmp.npz"
"""An enumeration that is not finished, there."""


def keep_table(table: Tabulation, folder: Path) -> None:
    """Keep a table in a folder, unless it is there; forget the enumeration that led to it."""
    if not (folder / TABLE).exists() and _kept(table.states):
        save_table(table, folder / TABLE)
    (folder / UNDER_WAY).unlink(missing_ok=True)


def kept_table(folder: Path, space: spaces.Space) -> Tabulation | None:
    """The table that a folder keeps; None where there is none, and where it was damaged or another's and is now deleted.

    Raises:
        InvalidParameter: a file that cannot be opened now; it stays.
    """
    try:
        return load_table(folder / TABLE, space)
    except FileNotFoundError:
        return None
    except InvalidMDP:
        (folder / TABLE).unlink()
        return None


def save_table(table: Tabulation, path: str | os.PathLike) -> None:
    """Write a table of a StateIndex, ListedStates or Cells; beside first, then renamed.

    Raises:
        InvalidMDP: states of another numbering, or cells of coordinates of another class than those here.
    """
    states, mdp = table.states, table.mdp
    if not _kept(states):
        raise InvalidMDP(
            f"the states are {type(states).__name__}: expected a StateIndex, ListedStates, or Cells of coordinates that no "
            "class of your own shows. Make such a table again instead."
        )
    evidence = asdict(table.evidence)
    none = np.zeros(0)
    arrays = dict(
        data=mdp.P.data, indices=mdp.P.indices, indptr=mdp.P.indptr, d0=mdp.d0, gamma=np.array(mdp.gamma),
        visits=none if mdp.visits is None else mdp.visits,
        horizon=none if mdp.horizon is None else np.array([mdp.horizon]),
        reward=table.reward.values, mean=table.payments.mean, deviation=table.payments.deviation,
        entries=none if table.payments.entries is None else table.payments.entries,
        largest=np.array(table.payments.largest),
        space=np.array(str(states.space)),
        numbers=states.numbers if isinstance(states, ListedStates) else none,
        copies=np.array(list(states.terminal_copies.items()), dtype=np.int64).reshape(-1, 2),
        **(_of_cells(states) if isinstance(states, Cells) else {}),
        evidence=np.array(json.dumps(evidence, default=plain_json, sort_keys=True)),
    )  # fmt: skip
    write_arrays(path, arrays)


def load_table(path: str | os.PathLike, space: spaces.Space) -> Tabulation:
    """What `save_table` wrote.

    Args:
        path: the file.
        space: observation space of the environment that the table is of.

    Raises:
        FileNotFoundError: no such file.
        InvalidMDP: a file that holds no table, or one of other observations.
        InvalidParameter: a file that cannot be opened now, which says nothing about what is in it.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist: expected a table, as `save_table` writes it.")
    try:
        found = read_arrays(path)
    except DamagedFile as error:
        raise InvalidMDP(f"{path} holds no table ({error}): expected what `save_table` writes.") from error
    except OSError as error:
        raise InvalidParameter(f"{path} cannot be read now ({error}): expected a table. Ask again when it can.") from error
    missing = [name for name, kinds in PARTS.items() if name not in found or found[name].dtype.kind not in kinds]
    if missing:
        raise InvalidMDP(f"{path} holds no table (no {missing[0]} is in it): expected what `save_table` writes.")
    if str(found["space"]) != str(space):
        told = str(found["space"])[:200]
        raise InvalidMDP(f"{path} holds a table of observations {told}: expected {space}. Is it another one's?")
    try:
        return _rebuilt(found, space, json_in(found, "evidence"))
    except (InvalidInput, NotDiscrete) as error:
        raise InvalidMDP(f"{path} holds no table ({error}): expected what `save_table` writes.") from error


def _rebuilt(found: dict[str, np.ndarray], space: spaces.Space, evidence: Any) -> Tabulation:
    """The table of arrays of the right kinds; whatever else they say is checked here."""
    d0 = found["d0"]
    P = checked_csr(
        found["data"], found["indices"], found["indptr"], (max(found["indptr"].size - 1, 0), d0.size), "P", InvalidMDP
    )  # fmt: skip
    visits = found.get("visits", np.zeros(0))  # tables of earlier versions have none
    horizon = found.get("horizon", np.zeros(0))
    if horizon.size > 1:
        raise InvalidMDP(f"its horizon has shape {horizon.shape}: expected one number, or none.")
    horizon = horizon.item() if horizon.size else None
    mdp = TabularMDP(P, _number("gamma", found), d0, visits if visits.size else None, horizon)
    rows, copies = (mdp.n_states, mdp.n_actions), found["copies"]
    reward = TabularReward(found["reward"], {"source": "environment"})
    entries = found["entries"] if found["entries"].size else None
    shapes: dict[str, tuple[int, ...]] = {"reward": rows, "mean": rows, "deviation": rows, "copies": (copies.size // 2, 2)}
    if entries is not None:
        shapes["entries"] = (mdp.P.nnz,)
    for name, shape in shapes.items():
        if found[name].shape != shape or not np.isfinite(found[name]).all():
            raise InvalidMDP(f"its {name} has shape {found[name].shape}: expected {shape} finite numbers.")
    payments = Payments(found["mean"], found["deviation"], entries, _number("largest", found))
    states = _numbering(found, space)
    if states.n_states != mdp.n_states:
        raise InvalidMDP(f"the table has {mdp.n_states} states and a numbering of {states.n_states}: expected as many.")
    return Tabulation(mdp, reward, payments, states, _evidence(evidence))


def _number(name: str, found: dict[str, np.ndarray]) -> float:
    """An array of one finite number.

    Raises:
        InvalidMDP: it is something else.
    """
    if found[name].shape != () or not np.isfinite(found[name]):
        raise InvalidMDP(f"its {name} is {found[name].ravel()[:3].tolist()}: expected one finite number.")
    return float(found[name])


def _evidence(told: Any) -> Evidence:
    """The evidence, of which every field is what `Evidence`, `SelfCheck` and `Repeats` say it is.

    Raises:
        InvalidMDP: one is not.
    """
    try:
        parts = {name: kind(**told.pop(name)) for name, kind in _FOUND.items() if told.get(name) is not None}
        evidence = Evidence(**{"check": None, **told, **parts})
        for part in (evidence, *parts.values()):
            for one, kind in get_type_hints(type(part)).items():
                if not _fits(getattr(part, one), kind):
                    raise TypeError(f"{one} is {getattr(part, one)!r:.40}")
        return evidence
    except (TypeError, AttributeError, OverflowError) as error:
        raise InvalidMDP(f"its evidence is not what a table has ({error}): expected that of `Evidence`.") from error


def _fits(value: Any, kind: Any) -> bool:
    """Is a value of json of the kind that a field has? A whole number may stand for a float."""
    kinds = get_args(kind) or (kind,)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return np.isfinite(float(value)) and (type(value) in kinds or float in kinds)
    return type(value) in kinds


SHOWING: dict[str, type[Coordinates]] = {kind.__name__: kind for kind in (Coordinates, IntegerCoordinate, CircularCoordinates)}
"""How observations show coordinates, by the name that a file has for it: no class is looked up elsewhere."""


CELLS = {"bins": "iu", "names": "U", "low": "f", "high": "f", "periodic": "b", "shown": "U"}
"""What a file holds of a grid, and the kinds of the arrays: one number a coordinate, and how it is shown."""


def _kept(states: Any) -> TypeGuard[StateIndex | ListedStates | Cells]:
    """Can a file hold this numbering?"""
    known = isinstance(states, Cells) and type(states.coordinates) in SHOWING.values()
    return known or isinstance(states, StateIndex | ListedStates)


def _of_cells(cells: Cells) -> dict[str, Any]:
    """What a file holds of a grid, but for its terminal copies and its space."""
    shown = cells.coordinates
    arrays = {"names": np.array(shown.names), "low": shown.low, "high": shown.high, "periodic": shown.periodic}
    return {f"cells.{name}": one for name, one in arrays.items()} | {
        "cells.bins": cells.shape, "cells.shown": np.array(type(shown).__name__)
    }  # fmt: skip


def _numbering(found: dict[str, np.ndarray], space: spaces.Space) -> StateIndex | ListedStates | Cells:
    """The rows' numbering."""
    if "cells.shown" in found:
        parts = [found.get(f"cells.{name}", np.zeros(0, dtype="O")) for name in CELLS]
        for (name, kinds), one in zip(CELLS.items(), parts, strict=True):
            if one.dtype.kind not in kinds or one.shape != (() if name == "shown" else (parts[0].size,)):
                raise InvalidMDP(f"its cells.{name} has shape {one.shape} and dtype {one.dtype}: expected one a coordinate.")
        bins, names, low, high, periodic, shown = parts
        if str(shown) not in SHOWING:
            raise InvalidMDP(f"its cells are of {str(shown)[:40]!r}: expected one of {', '.join(SHOWING)}.")
        coordinates = SHOWING[str(shown)](space, tuple(map(str, names)), low, high, periodic)
        cells = Cells(coordinates, bins.tolist(), found["copies"][:, 0])
        last, rising = cells.n_cells - 1, bool((np.diff(cells.ending, prepend=-1) > 0).all())
        if not rising or cells.ending.max(initial=0) > last or cells.decode(0).shape != (space.shape or ()):
            raise InvalidMDP(f"cells of {space} end in {cells.ending[:9]}: expected increasing numbers, 0 to {last}.")
        return cells
    copies = dict(found["copies"].tolist())
    return ListedStates(space, found["numbers"], copies) if found["numbers"].size else StateIndex(space, copies)
