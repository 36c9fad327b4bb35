"""What was asked is noted as it is answered, so that a kill, or a keyboard that is closed, costs no answer and no training.

    answers.txt     a line an answer: ask or gate, a digest of the observation, the answer
    fit-*.npz       what was learned from the labels so far, by a digest of them and of the class
Who goes on plays the same episodes again, from the same seed, with the answers of the file, and asks from its end on: all ends
as in one go. A function, which may be a person, is not called again. A policy is: one that draws its mistakes goes on from
there; and what it says has to be the same.
"""

import hashlib
import pickle
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.errors import DamagedFile, RunConflict
from irl_gym.files.archives import read_arrays
from irl_gym.files.own_files import write_arrays
from irl_gym.learners.problem import Oracle
from irl_gym.mdp.policies import Policy
from irl_gym.spaces.batches import by_part

ANSWERS = "answers.txt"
LINE = re.compile(r"(ask|gate) ([0-9a-f]{16}) ([0-9]{1,9})")
_DELETE = "Choose another folder, or delete it, and all is asked anew."


class Noted:
    """An oracle whose answers are in a file, as far as they are there; further ones are added.

    Args:
        oracle: who answers. What the file answers counts as asked.
        folder: of the file; made if it is not there.

    Raises:
        RunConflict: the file cannot be read.
    """

    def __init__(self, oracle: Oracle, folder: Path):
        folder.mkdir(parents=True, exist_ok=True)
        self._oracle, self.path, self._at = oracle, folder / ANSWERS, 0
        try:
            text = self.path.read_text("ascii") if self.path.exists() else ""
        except (OSError, ValueError) as error:
            raise RunConflict(f"{self.path} cannot be read ({error}): expected the answers of an oracle. {_DELETE}") from error
        whole = text[: text.rfind("\n") + 1]  # a kill may have cut a line
        self._lines = whole.splitlines()
        if whole != text:
            self.path.write_text(whole, "ascii")

    @property
    def queries(self) -> int:
        """How often it was asked, the file among it."""
        return self._oracle.queries

    @property
    def left(self) -> int:
        """Answers of the file that are still to come."""
        return max(0, len(self._lines) - self._at)

    def ask(self, observation: Any, info: Mapping[str, Any] | None = None, *, n_actions: int | None = None) -> int:
        """What is to be done; see `Oracle.ask`.

        Raises:
            InvalidPolicy: the answer is no action.
            RunConflict: the file is of other questions.
        """
        drawn = isinstance(self._oracle.policy, Policy)

        def again() -> int | None:
            if drawn:
                return self._oracle.ask(observation, info, n_actions=n_actions)
            self._oracle.queries += 1
            return None

        most = 10**9 if n_actions is None else n_actions
        return self._answered("ask", observation, again, lambda: self._oracle.ask(observation, info, n_actions=n_actions), most)

    def takes_over(self, observation: Any, info: Mapping[str, Any] | None, action: int) -> bool:
        """Does it act? See `Oracle.takes_over`; errors as `ask`."""
        return bool(
            self._answered(
                "gate", observation, lambda: None, lambda: int(self._oracle.takes_over(observation, info, action)), 2
            )
        )

    def _answered(self, kind: str, observation: Any, again: Callable[[], int | None], new: Callable[[], int], most: int) -> int:
        told, number = _digest_of(observation), self._at
        self._at += 1
        if number < len(self._lines):
            line = LINE.fullmatch(self._lines[number])
            now = again()
            if line is None or line[1] != kind or line[2] != told or int(line[3]) >= most or now not in (None, int(line[3])):
                raise RunConflict(
                    f"{self.path}, line {number + 1} is {self._lines[number]!r:.60}: expected the answer to {kind} {told}, as "
                    f"from the same seed, environment and oracle. {_DELETE}"
                )
            return int(line[3])
        answer = new()
        with self.path.open("a", encoding="ascii") as file:
            file.write(f"{kind} {told} {answer}\n")
        return answer


def _digest_of(observation: Any) -> str:
    """16 hexadecimal digits that tell one observation from another."""
    told = hashlib.sha256()

    def add(part: Any) -> None:
        array = np.asarray(part)
        told.update(f"{array.dtype.str if array.dtype.kind == 'f' else array.dtype.kind}{array.shape}".encode())
        told.update(repr(part).encode() if array.dtype.hasobject else np.ascontiguousarray(array).tobytes())

    by_part(add, observation)
    return told.hexdigest()[:16]


def fitted(
    folder: Path | None, of: Any, fit: Callable[[], Any], arrays: Callable[[Any], Mapping[str, Any]],
    made: Callable[[Mapping[str, Any]], Any],
) -> Any:  # fmt: skip
    """What was learned from labels: from a file, if it is there and can be read, else learned now and kept.

    Args:
        folder: of the files; None for none.
        of: all that it depends on; what cannot be pickled is learned each time.
        fit: learns.
        arrays: of what was learned, numbers by name.
        made: the same of these; raises DamagedFile, ValueError or KeyError where they are none.
    """
    try:
        path = None if folder is None else folder / f"fit-{hashlib.sha256(pickle.dumps(of, protocol=4)).hexdigest()[:16]}.npz"
    except Exception:  # whatever a class of somebody's own raises
        path = None
    if path is not None and path.exists():
        try:
            return made(read_arrays(path))
        except (OSError, DamagedFile, ValueError, KeyError):
            pass
    found = fit()
    if path is not None:
        write_arrays(path, arrays(found))
    return found
