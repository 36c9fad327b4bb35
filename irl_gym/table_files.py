"""Tables as files: an npz of numbers, and the evidence as json; nothing in it is ever unpickled.

The observation space is not kept: who reads the file gives it, and it is compared.
"""

import errno
import json
import os
import struct
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import scipy.sparse as sp
from gymnasium import spaces

from irl_gym.cells import Cells
from irl_gym.coordinates import CircularCoordinates, Coordinates, IntegerCoordinate
from irl_gym.errors import InvalidMDP, InvalidParameter
from irl_gym.listed_states import ListedStates
from irl_gym.mdp import TabularMDP
from irl_gym.repeats import Repeats
from irl_gym.rewards import UNREADABLE, TabularReward, plain_json
from irl_gym.selfcheck import Payments, SelfCheck
from irl_gym.states import StateIndex
from irl_gym.tabulation import Evidence, Tabulation

TABLE = "table.npz"
"""The table in the folder of a run."""
DAMAGE = (*UNREADABLE, LookupError, RuntimeError, struct.error)
"""What reading raises of a file that is damaged: zipfile takes a changed bit for encryption, too."""
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
    states, mdp, path = table.states, table.mdp, Path(path)
    if not _kept(states):
        raise InvalidMDP(
            f"the states are {type(states).__name__}: expected a StateIndex, ListedStates, or Cells of coordinates that no "
            "class of your own shows. Make such a table again instead."
        )
    evidence = asdict(table.evidence)
    none = np.zeros(0)
    beside = path.with_name(f".{path.name}.tmp.npz")
    np.savez(
        beside,
        data=mdp.P.data, indices=mdp.P.indices, indptr=mdp.P.indptr, d0=mdp.d0, gamma=np.array(mdp.gamma),
        visits=none if mdp.visits is None else mdp.visits,
        reward=table.reward.values, mean=table.payments.mean, deviation=table.payments.deviation,
        entries=none if table.payments.entries is None else table.payments.entries,
        largest=np.array(table.payments.largest),
        space=np.array(str(states.space)),
        numbers=states.numbers if isinstance(states, ListedStates) else none,
        copies=np.array(list(states.terminal_copies.items()), dtype=np.int64).reshape(-1, 2),
        **(_of_cells(states) if isinstance(states, Cells) else {}),
        evidence=np.array(json.dumps(evidence, default=plain_json, sort_keys=True)),
    )  # fmt: skip
    os.replace(beside, path)


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
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:  # a broken file is closed too
            found = {name: archive[name] for name in archive.files}
        if str(found["space"]) != str(space):
            raise InvalidMDP(f"{path} holds a table of observations {found['space']}: expected {space}. Is it another one's?")
        return _rebuilt(found, space)
    except InvalidMDP:
        raise
    except DAMAGE as error:
        if isinstance(error, OSError) and error.errno != errno.EINVAL:  # zipfile sought a place before the file's start
            raise InvalidParameter(f"{path} cannot be read now ({error}): expected a table. Ask again when it can.") from error
        raise InvalidMDP(f"{path} holds no table ({error}): expected what `save_table` writes.") from error


def _rebuilt(found: dict[str, np.ndarray], space: spaces.Space) -> Tabulation:
    shape = (found["indptr"].size - 1, found["d0"].size)
    visits = found.get("visits", np.zeros(0))  # tables of earlier versions have none
    mdp = TabularMDP(
        sp.csr_array((found["data"], found["indices"], found["indptr"]), shape=shape), float(found["gamma"]), found["d0"],
        visits if visits.size else None,
    )  # fmt: skip
    entries = found["entries"] if found["entries"].size == mdp.P.nnz else None
    payments = Payments(found["mean"], found["deviation"], entries, float(found["largest"]))
    states = _numbering(found, space)
    if states.n_states != mdp.n_states:
        raise InvalidMDP(f"the table has {mdp.n_states} states and a numbering of {states.n_states}: expected as many.")
    evidence = json.loads(str(found["evidence"]))
    for name, kind in (("check", SelfCheck), ("repeats", Repeats)):
        evidence[name] = None if evidence.get(name) is None else kind(**evidence[name])
    reward = TabularReward(found["reward"], {"source": "environment"})
    return Tabulation(mdp, reward, payments, states, Evidence(**evidence))


SHOWING: dict[str, type[Coordinates]] = {kind.__name__: kind for kind in (Coordinates, IntegerCoordinate, CircularCoordinates)}
"""How observations show coordinates, by the name that a file has for it: no class is looked up elsewhere."""


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
        names, low, high, periodic, bins, shown = (
            found[f"cells.{name}"] for name in ("names", "low", "high", "periodic", "bins", "shown")
        )
        coordinates = SHOWING[str(shown)](space, tuple(map(str, names)), low, high, periodic)
        cells = Cells(coordinates, bins.tolist(), found["copies"][:, 0])
        last, rising = cells.n_cells - 1, bool((np.diff(cells.ending, prepend=-1) > 0).all())
        if not rising or cells.ending.max(initial=0) > last or cells.decode(0).shape != (space.shape or ()):
            raise InvalidMDP(f"cells of {space} end in {cells.ending[:9]}: expected increasing numbers, 0 to {last}.")
        return cells
    copies = {int(row): int(copy) for row, copy in found["copies"]}
    return ListedStates(space, found["numbers"], copies) if found["numbers"].size else StateIndex(space, copies)
