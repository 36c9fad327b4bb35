"""What the loop's command line asks for, and the experiment that it stands for."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from gymnasium import spaces

from irl_gym.choices import (
    KNOWN,
    FeatureName,
    LearnerName,
    PlannerName,
    Reveals,
    environment_of,
    features_named,
    planner_named,
    steps_only,
)
from irl_gym.counting import Interaction
from irl_gym.enumeration.table import Enumeration
from irl_gym.errors import InvalidParameter
from irl_gym.experiment import Experiment, parse_keywords
from irl_gym.given import FromFile
from irl_gym.learners.feature import FeatureLP
from irl_gym.learners.finite import FiniteLP
from irl_gym.learners.trajectory import TrajectoryLP
from irl_gym.planners import Planner


@dataclass(frozen=True)
class Arguments:
    """Recover a reward from an expert, retrain an agent that sees only that reward, and judge it under the true one."""

    env_id: str | None = None
    """A registered environment; module:id for one of another package. The default is the dataset's, or FrozenLake-v1."""
    env_kwargs: tuple[str, ...] = ()
    """What the environment is made with: name=value ..., or one json object."""
    gamma: float = 0.99
    """Discount, between 0 and 1."""
    start_seeds: tuple[int, ...] = ()
    """Draw the layouts of resets from these seeds only; 0 fixes the layout of a MiniGrid environment."""
    reveal: tuple[str, ...] = ("known",)
    """Hidden integers that the observation shall show: name=number of values ...; known for those known to be hidden; none."""
    table: Literal["auto", "enumerate", "sample"] = "auto"
    """auto: what the environment publishes, else its states enumerated; or enumerate, or count what random steps do."""
    max_states: int | None = None
    """States that an enumeration may find."""
    steps: int | None = None
    """Random steps that are counted (--table sample); the default is 100,000."""
    bins: tuple[int, ...] = ()
    """Make a table of continuous states: cells along each coordinate, or one number for all."""
    samples: int = 0
    """Points drawn in each cell, whose steps are counted; 0 for the step from its centre, shared between neighbours."""
    dataset: str | None = None
    """Learn from this Minari dataset, in place of an expert's policy."""
    dataset_root: str | None = None
    """Minari's root folder."""
    expert: str | None = None
    """Who demonstrates: value-iteration (exact planning on a table); ppo, dqn or a2c, trained on the true reward; or a file,
    SB3's zip of an agent or an npz of actions."""
    epsilon: float = 0.0
    """Probability of a random action in place of the expert's. Above 0 learners see the episodes only, not the policy."""
    episodes: int = 500
    """Demonstrations recorded; only trajectory-lp learns from them, the others from the expert's whole policy, unless it errs
    (--epsilon)."""
    learner: LearnerName = "finite-lp"
    """Ng & Russell's section 3 (finite-lp), 4 (feature-lp) or 5 (trajectory-lp)."""
    l1: float | Literal["auto"] = 0.0
    """Price of ||R||_1, of ||alpha||_1 with features: a number, or auto for just below lambda_0 (finite-lp)."""
    margin_cap: float | Literal["auto", "none"] = "auto"
    """finite-lp and feature-lp. Cap on margins: a number, auto, or none for the paper's own program."""
    slack: float | Literal["auto", "none"] = "auto"
    """finite-lp. Price of preferring another action to the expert's, where a margin is worth 1; none for at no price. auto is
    1 where the expert is known by its episodes."""
    reward_on: Literal["state", "state-action"] = "state"
    """finite-lp. What the recovered reward is a function of."""
    features: FeatureName = "auto"
    """feature-lp and trajectory-lp. auto is one-hot for discrete observations, radial for others."""
    size: int | None = None
    """Of the features: centres along each coordinate, Fourier order, or degree."""
    coordinates: tuple[int, ...] = ()
    """Values of each coordinate that a discrete observation is made of, such as 5 5 5 4 for Taxi."""
    sample: int | None = None
    """feature-lp. States in S_0, drawn at random; the default is all."""
    rounds: int | None = None
    """trajectory-lp. At most; the default is 30 on tables, 8 on environments that are stepped."""
    gap_cap: Literal["auto", "none"] = "none"
    """trajectory-lp. auto lets no policy that is far worse than the expert outweigh the others."""
    inner: PlannerName | None = None
    """trajectory-lp. Who solves for each reward tried."""
    shaping: bool = True
    """Retrain on the expected advantage under the recovered reward, computed from the table; else on the reward as it is."""
    retrain: PlannerName = "ppo"
    """Who learns from the recovered reward."""
    total_timesteps: int | None = None
    """Environment steps of each SB3 agent; the default is 400,000 on tables, 60,000 on environments that are stepped."""
    seed: int = 0
    """Of everything that is drawn."""
    out: Path | None = None
    """Where the run is kept, and continued if it was killed. The default is a folder of its own under runs/."""

    def experiment(self) -> Experiment:
        """What the arguments ask for."""
        env_id = self.env_id or (None if self.dataset else "FrozenLake-v1")
        env_kwargs = parse_keywords(self.env_kwargs)
        reveal = parse_reveal(self.reveal)
        control, discrete, cap = False, False, None if self.margin_cap == "none" else self.margin_cap
        if self.learner == "finite-lp":
            learner: Any = FiniteLP(
                l1=self.l1, margin_cap=cap, reward_on=self.reward_on, report_lambda_0=True, slack=self._slack()
            )
        else:
            env = environment_of(
                env_id, env_kwargs, self.dataset, self.dataset_root, start_seeds=self.start_seeds, reveal=reveal
            )
            control = not self.bins and steps_only(env)
            discrete = isinstance(env.observation_space, spaces.Discrete)
            phi = features_named(self.features, env, size=self.size, coordinates=self.coordinates or None)
            l1: Any = self.l1
            if self.learner == "feature-lp":
                learner = FeatureLP(phi, self.sample, margin_cap=cap, l1=l1, seed=self.seed)
            else:
                rounds = self.rounds if self.rounds is not None else 8 if control else 30
                learner = TrajectoryLP(
                    phi, gap_cap="auto" if self.gap_cap == "auto" else None, l1=l1, max_rounds=rounds, seed=self.seed
                )
        shaped = self.shaping and not control

        def planner(name: PlannerName | None, *, advantages: bool = False) -> Planner | None:
            if name is None and control:
                name = "ppo"
            return planner_named(name, self.total_timesteps, advantages=advantages, control=control, discrete=discrete)

        file = self._expert_file()
        expert = planner(cast("PlannerName | None", self.expert)) if file is None else FromFile.at(file)
        bins = self.bins[0] if len(self.bins) == 1 else self.bins or None
        return Experiment(
            env_id, self.gamma, env_kwargs, self.start_seeds, reveal, self._by(), bins, self.samples, self.dataset,
            self.dataset_root, expert=expert, epsilon=self.epsilon, episodes=self.episodes, learner=learner,
            inner=planner(self.inner), shaping=self.shaping, retrain=planner(self.retrain, advantages=shaped), seed=self.seed,
        )  # fmt: skip

    def _expert_file(self) -> str | None:
        if self.expert is None or self.expert in get_args(PlannerName):
            return None
        if Path(self.expert).suffix in (".zip", ".npz") or Path(self.expert).exists():
            return self.expert
        raise InvalidParameter(
            f"expert is {self.expert!r}: expected one of {', '.join(get_args(PlannerName))}, or a file, SB3's zip of an agent "
            "or an npz of actions."
        )

    def _slack(self) -> float | None:
        if self.slack == "auto":
            from_episodes = self.dataset is not None or self.epsilon > 0
            return 1.0 if from_episodes and self.reward_on == "state" else None
        return None if self.slack == "none" else self.slack

    def _by(self) -> Enumeration | Interaction | None:
        """How a table is made."""
        if self.steps is not None and self.table != "sample":
            raise InvalidParameter(f"steps is {self.steps}, but table is {self.table!r}: expected --table sample with it.")
        if self.max_states is not None and self.table == "sample":
            raise InvalidParameter(f"max_states is {self.max_states}, but table is 'sample': expected --steps with it.")
        if self.table == "sample":
            return Interaction(seed=self.seed) if self.steps is None else Interaction(self.steps, seed=self.seed)
        if self.max_states is not None:
            return Enumeration(known=self.table == "auto", max_states=self.max_states)
        return None if self.table == "auto" else Enumeration()


def parse_reveal(parts: Sequence[str]) -> Reveals:
    """What is to be revealed, given as text: "known", "none", or name=number of values ...

    Raises:
        InvalidParameter: anything else.
    """
    if list(parts) in ([KNOWN], ["none"], []):
        return KNOWN if list(parts) == [KNOWN] else {}
    found = {}
    for part in parts:
        name, equals, number = part.partition("=")
        if not equals or not number.isdecimal():
            raise InvalidParameter(
                f"reveal has {part!r}: expected name=number of values, such as step_count=100; or known, or none."
            )
        found[name] = int(number)
    return found
