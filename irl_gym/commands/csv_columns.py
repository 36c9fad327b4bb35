"""What the command line asks for of a file with a row for each step: which column is what; and the dataset made of it."""

import hashlib
import json
import re
import shlex
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from irl_gym.commands.terminal import UNSET, print_error
from irl_gym.demonstrations.choices import Last
from irl_gym.errors import DatasetMissing, InvalidDemonstrations, InvalidParameter

if TYPE_CHECKING:
    import gymnasium as gym

    from irl_gym.mdp.episodes import Episode

NONE = "none"
"""What names no column."""
ARGUMENT = re.compile(
    r"\b(?:(?P<one>episode|step|action|reward|terminated|truncated)|(?P<several>(?:next_)?observation)(?: (?P<place>\d+))?"
    r"|(?P<last>last))=(?P<value>None|\.\.\.|'[^']*'|\"[^\"]*\")"
)
"""An argument of `from_frame`, in the mend of an error."""


@dataclass(frozen=True)
class Log:
    """Episodes in a file that ends in .csv, .tsv or .parquet, with a header and a row for each step."""

    csv: Annotated[Path | None, UNSET] = None
    """The file; --env-id names the environment that it was recorded in. Parquet needs the extra `data`."""
    episode_column: str = "episode"
    """Id of the episode; none: a row that is terminated or truncated ends an episode."""
    step_column: str = "step"
    """Rows are sorted by it; none: they are in order."""
    observation_columns: tuple[str, ...] = ("observation",)
    """What was seen before the action: a column, or several, the numbers of a vector."""
    action_column: str = "action"
    """Whole numbers; none: only the states are known, and the last row of an episode is its last observation."""
    reward_column: str = "reward"
    """May be missing: no learner reads it."""
    terminated_column: str = "terminated"
    """True in the last row of an episode that the environment ended; may be missing."""
    truncated_column: str = "truncated"
    """True in the last row of an episode that a time limit ended; may be missing."""
    next_observation_columns: Annotated[tuple[str, ...], UNSET] = ()
    """What was seen after the action, where the file says it."""
    last: Last = "keep"
    """Where it does not: keep the last action of each episode, drop it, repeat its observation; or its row has none."""

    @property
    def sha256(self) -> str:
        """Of the file, in hexadecimal digits.

        Raises:
            DatasetMissing: there is no such file.
        """
        if self.csv is None or not self.csv.is_file():
            raise DatasetMissing(f"csv is {self.csv}, and there is no such file: expected one with a row for each step.")
        with self.csv.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    @property
    def dataset_id(self) -> str:
        """What the dataset made of the file is called: another one where the file or the columns are others."""
        asked = {name: value for name, value in asdict(self).items() if name != "csv"} | {"sha256": self.sha256}
        digest = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]
        name = re.sub(r"[^-A-Za-z0-9]+", "-", Path(str(self.csv)).stem).strip("-").lower()
        return f"csv/{name or 'log'}-{digest}-v0"

    def episodes(self, env: "gym.Env") -> "list[Episode]":
        """The episodes of the file; what of it is left out is said on standard error.

        Args:
            env: they are checked against its spaces.

        Raises:
            InvalidDemonstrations: a column that is missing, or a row that cannot be right.
            NotInstalled: no pyarrow for a Parquet file.
        """
        from irl_gym.demonstrations.imports import from_frame

        names = ("episode", "step", "action", "reward", "terminated", "truncated")
        asked = {name: getattr(self, f"{name}_column") for name in names}
        columns: dict[str, Any] = {name: None if column == NONE else column for name, column in asked.items()}
        following = None if self.next_observation_columns in ((), (NONE,)) else _columns(self.next_observation_columns)
        seen = _columns(self.observation_columns)
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                found = from_frame(self.csv, observation=seen, next_observation=following, last=self.last, env=env, **columns)
        except (InvalidDemonstrations, InvalidParameter) as error:
            raise type(error)(ARGUMENT.sub(self._option, str(error))) from error
        for one in said:  # what is left out, in a line each
            print_error(one.category(ARGUMENT.sub(self._option, str(one.message))))
        return found

    def _option(self, argument: re.Match[str]) -> str:
        """The option that stands for an argument on the command line; of several columns all are named."""
        value = {"None": NONE, "...": "NAME"}.get(argument["value"], argument["value"].strip("'\""))
        if argument["several"] is None:
            return f"--{argument['last'] or argument['one'] + '-column'} {shlex.quote(value)}"
        names = [*getattr(self, f"{argument['several']}_columns")]
        names[int(argument["place"] or 0)] = value
        return f"--{argument['several'].replace('_', '-')}-columns {shlex.join(names)}"

    def write(self, episodes: "list[Episode]", env: "gym.Env", dataset_id: str, root: Path | None, **how: Any) -> Any:
        """Write episodes of the file as a Minari dataset, which says what they were read from; `how` is for `write_minari`.

        Raises:
            DatasetExists: the id is taken.
        """
        from irl_gym.demonstrations.datasets import write_minari
        from irl_gym.demonstrations.minari_files import unkept

        lost = unkept(env.spec)
        told = f"Made of {Path(str(self.csv)).name}, sha256 {self.sha256}."
        return write_minari(
            episodes, dataset_id, None if lost else env, root=root, algorithm="not known",
            description=f"{told} {lost}" if lost else told, observation_space=env.observation_space,
            action_space=env.action_space, **how,
        )  # fmt: skip


def _columns(names: tuple[str, ...]) -> str | list[str]:
    return names[0] if len(names) == 1 else [*names]
