"""What the loop's command line asks for, group by group, and the experiment that it stands for.

The records are read before anything is imported that they stand for: what makes something of them imports it.
"""

import ast
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast, get_args

from irl_gym.commands.csv_columns import Log
from irl_gym.commands.learning_arguments import Learning
from irl_gym.commands.terminal import UNSET
from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.errors import InvalidParameter, did_you_mean
from irl_gym.runs.choices import KNOWN, TAKEN, PlannerName, Reveals

if TYPE_CHECKING:
    from irl_gym.agents.planners import Planner
    from irl_gym.runs.experiment import Experiment
    from irl_gym.tables.tabulate import By

MOST_SEEDS = 26
"""Runs that a page sets side by side."""


@dataclass(frozen=True)
class Environment:
    """What is acted in."""

    env_id: Annotated[str | None, UNSET] = None
    """A registered environment; module:id for one of another package. The default is the dataset's, or FrozenLake-v1."""
    env_kwargs: Annotated[tuple[str, ...], UNSET] = ()
    """What it is made with: name=value ..., or one json object."""
    gamma: float = 0.99
    """Discount, between 0 and 1."""
    start_seeds: Annotated[tuple[int, ...], UNSET] = ()
    """Draw the layouts of resets from these seeds only; 0 fixes the layout of a MiniGrid environment."""
    reveal: tuple[str, ...] = ("known",)
    """Hidden integers that the observation shall show: name=number of values ...; known for those known to be hidden; none."""


@dataclass(frozen=True)
class Table:
    """How the table of its transitions is made."""

    table: Literal["auto", "enumerate", "sample"] = "auto"
    """auto: what the environment publishes, else its states enumerated; or enumerate, or count what random steps do."""
    max_states: Annotated[int | None, UNSET] = None
    """States that an enumeration may find; the default is 300,000."""
    steps: Annotated[int | None, UNSET] = None
    """Random steps that are counted (--table sample); the default is 100,000."""
    bins: Annotated[tuple[int, ...], UNSET] = ()
    """Make a table of continuous states: cells along each coordinate, or one number for all."""
    samples: int = 0
    """Points drawn in each cell, whose steps are counted; 0 for the step from its centre, shared between neighbours."""

    @property
    def cells(self) -> int | tuple[int, ...] | None:
        """Cells along each coordinate, or one number for all; None for no table of cells."""
        return self.bins[0] if len(self.bins) == 1 else self.bins or None

    def by(self, seed: int) -> "By | None":
        """How a table is made."""
        from irl_gym.tables.counted.counting import Interaction
        from irl_gym.tables.enumeration.table import Enumeration

        if self.steps is not None and self.table != "sample":
            raise InvalidParameter(f"steps is {self.steps}, but table is {self.table!r}: expected --table sample with it.")
        if self.max_states is not None and self.table == "sample":
            raise InvalidParameter(f"max_states is {self.max_states}, but table is 'sample': expected --steps with it.")
        if self.table == "sample":
            return Interaction(seed=seed) if self.steps is None else Interaction(self.steps, seed=seed)
        if self.max_states is not None:
            return Enumeration(known=self.table == "auto", max_states=self.max_states)
        return None if self.table == "auto" else Enumeration()


@dataclass(frozen=True)
class Demonstrations:
    """Who shows what is wanted."""

    expert: Annotated[str | None, UNSET] = None
    """value-iteration, on a table; ppo, dqn or a2c, trained on the true reward; or a file, SB3's zip or an npz of actions."""
    expert_normalize: Annotated[str | None, UNSET] = None
    """Statistics of its observations, of a zip trained under SB3's VecNormalize: the file of its save, or an npz."""
    epsilon: float = 0.0
    """Probability of a random action in place of the expert's. Above 0 learners see the episodes only, not the policy."""
    episodes: int = 500
    """Recorded; trajectory-lp learns from them, the others from the expert's whole policy, unless it errs (--epsilon)."""
    dataset: Annotated[str | None, UNSET] = None
    """Learn from this Minari dataset, in place of an expert."""
    dataset_root: Annotated[str | None, UNSET] = None
    """Minari's root folder; the default is Minari's own."""
    trust_dataset: bool = False
    """Import and call whatever the dataset says it was recorded in; else that has to be registered here."""
    after_end: AfterEnd = "refuse"
    """Of an episode of the dataset that goes on after its end: refuse it, or cut it there."""

    @property
    def file(self) -> str | None:
        """The expert's file; None for an expert that has a name.

        Raises:
            InvalidParameter: no such expert, or statistics of one that has no file.
        """
        if self.expert is None or self.expert in get_args(PlannerName):
            if self.expert_normalize is not None:
                raise InvalidParameter(
                    f"expert_normalize is {self.expert_normalize!r}, but expert is {self.expert}: expected an agent's zip "
                    "with it."
                )
            return None
        if Path(self.expert).suffix in (".zip", ".npz") or Path(self.expert).exists():
            return self.expert
        raise InvalidParameter(
            f"expert is {self.expert!r}: expected one of {', '.join(get_args(PlannerName))}, or a file, SB3's zip of an agent "
            f"or an npz of actions.{did_you_mean(self.expert, get_args(PlannerName))}"
        )


@dataclass(frozen=True)
class Retraining:
    """Who learns from the recovered reward."""

    retrain: PlannerName = "ppo"
    """Who it is."""
    warm_start: Literal["none", "clone"] = "none"
    """ppo and a2c. clone: training begins with a network that is cloned from the demonstrations, in place of a random one."""
    shaping: bool = True
    """Retrain on the expected advantage under the recovered reward, computed from the table; else on the reward as it is."""
    total_timesteps: Annotated[int | None, UNSET] = None
    """Environment steps of each SB3 agent; the default is 400,000 on tables, 60,000 on environments that are stepped."""


@dataclass(frozen=True)
class Arguments:
    """Recover a reward from an expert, retrain an agent that sees only that reward, and judge it under the true one."""

    environment: Environment = Environment()
    """What is acted in."""
    table: Table = Table()
    """How the table of its transitions is made."""
    demonstrations: Demonstrations = Demonstrations()
    """Who shows what is wanted."""
    file: Log = field(default_factory=Log)
    """Or episodes in a file."""
    learning: Learning = field(default_factory=Learning)
    """How the reward is recovered."""
    retraining: Retraining = Retraining()
    """Who learns from the recovered reward."""
    seed: int = 0
    """Of everything that is drawn."""
    seeds: Annotated[str | None, UNSET] = None
    """Several runs, such as 0-4 or 0,3,7: each is kept in a folder seed-N of --out, and they are taken together."""
    out: Annotated[Path | None, UNSET] = None
    """Where the run is kept, and continued if it was killed. The default is a folder of its own under runs/."""

    def learning_from(self, dataset: str, root: str | None) -> "Arguments":
        """The same, learning from the dataset that was made of the file in place of the file.

        Raises:
            InvalidParameter: no environment, or another source of demonstrations beside the file.
        """
        shown = self.demonstrations
        if self.environment.env_id is None:
            raise InvalidParameter(
                f"csv is {self.file.csv}, and no environment is named: expected the one that it was recorded in. Name it with "
                "--env-id."
            )
        if shown.dataset is not None or shown.expert is not None or shown.epsilon:
            raise InvalidParameter(
                f"csv is {self.file.csv}, but a dataset, an expert or epsilon is given too: expected the episodes of the file "
                "as they are. Leave the others out."
            )
        return replace(self, file=Log(), demonstrations=replace(shown, dataset=dataset, dataset_root=root))

    def experiment(self) -> "Experiment":
        """What the arguments ask for.

        Raises:
            InvalidParameter: arguments that contradict each other, or are outside their range.
            UnknownEnvironment, DatasetMissing: no such environment or dataset, where a learner has to know it.
        """
        from gymnasium import spaces

        from irl_gym.agents.expert_files import FromFile
        from irl_gym.learners.registry import learner_of
        from irl_gym.runs.choices import parse_keywords
        from irl_gym.runs.experiment import Experiment
        from irl_gym.runs.named_parts import environment_of, planner_named, steps_only

        given, shown = self.environment, self.demonstrations
        env_id = given.env_id or (None if shown.dataset else "FrozenLake-v1")
        env_kwargs, reveal = parse_keywords(given.env_kwargs), parse_reveal(given.reveal)
        control, discrete, features = False, False, None
        self.learning.check()
        if self.learning.learner == "finite-lp":
            learner: Any = self.learning.finite(from_episodes=shown.dataset is not None or shown.epsilon > 0)
        else:
            named = self.learning.learner
            own = None if named in TAKEN else learner_of(named, self.learning.own)
            self.learning.check(None if own is None else own.needs)
            env = environment_of(
                env_id, env_kwargs, shown.dataset, shown.dataset_root, start_seeds=given.start_seeds, reveal=reveal,
                trust_dataset=shown.trust_dataset,
            )  # fmt: skip
            control = not self.table.bins and steps_only(env)
            discrete = isinstance(env.observation_space, spaces.Discrete)
            learner = self.learning.linear(env, control, self.seed) if own is None else own
            if own is not None and "features" in own.needs.parts:
                features = self.learning.phi(env)
        shaped = self.retraining.shaping and not control

        def planner(name: PlannerName | None, *, advantages: bool = False) -> "Planner | None":
            if name is None and control:
                name = "ppo"
            steps = self.retraining.total_timesteps
            return planner_named(name, steps, advantages=advantages, control=control, discrete=discrete)

        file = shown.file
        named = planner(cast("PlannerName | None", shown.expert)) if file is None else None
        expert = named if file is None else FromFile.at(file, shown.expert_normalize)
        return Experiment(
            env_id, given.gamma, env_kwargs, given.start_seeds, reveal, self.table.by(self.seed),
            self.table.cells, self.table.samples, shown.dataset, shown.dataset_root,
            shown.trust_dataset,
            shown.after_end, expert=expert, epsilon=shown.epsilon, episodes=shown.episodes, learner=learner, features=features,
            inner=planner(self.learning.inner), shaping=self.retraining.shaping,
            retrain=planner(self.retraining.retrain, advantages=shaped), seed=self.seed,
            warm_start=None if self.retraining.warm_start == "none" else self.retraining.warm_start,
        )  # fmt: skip


def parse_seeds(text: str) -> list[int]:
    """Seeds, given as text: numbers and ranges with commas between them, such as 0-4 or 0,3,7.

    Raises:
        InvalidParameter: anything else, a seed twice, or more than a page sets side by side.
    """
    found: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"\s*(\d{1,9})\s*(?:-\s*(\d{1,9})\s*)?", part)
        first, last = (0, -1) if ends is None else (int(ends[1]), int(ends[2] or ends[1]))
        if last < first or last - first >= MOST_SEEDS or {*found} & {*range(first, last + 1)}:
            found = []
            break
        found += range(first, last + 1)
    if not 0 < len(found) <= MOST_SEEDS:
        raise InvalidParameter(
            f"seeds is {text!r:.80}: expected whole numbers, each once and at most {MOST_SEEDS}, such as 0-4 or 0,3,7."
        )
    return found


def parse_reveal(parts: Sequence[str]) -> Reveals:
    """What is to be revealed, given as text: "known", "none", or name=number of values or name=[value, value] ...

    Raises:
        InvalidParameter: anything else.
    """
    if list(parts) in ([KNOWN], ["none"], []):
        return KNOWN if list(parts) == [KNOWN] else {}
    found: dict[str, int | list[Any]] = {}
    for part in parts:
        name, equals, values = part.partition("=")
        try:
            read = int(values) if values.isdecimal() else ast.literal_eval(values)
        except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):  # of too many digits, and of unhashable keys
            read = None
        if not equals or not isinstance(read, int if values.isdecimal() else list):
            raise InvalidParameter(
                f"reveal has {part!r}: expected name=number of values, such as step_count=100, or a list of them, such as "
                "last=[None,0,1]; or known, or none."
            )
        if name in found:
            raise InvalidParameter(f"reveal has {part!r} after {name}={found[name]}: expected each name once. Leave one out.")
        found[name] = read
    return found
