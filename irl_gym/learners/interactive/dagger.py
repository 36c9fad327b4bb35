"""DAgger, dataset aggregation (Ross, Gordon & Bagnell 2011, algorithm 3.1): clone what the oracle says where the learner goes.

    round i   visits under pi_i = beta_i pi* + (1 - beta_i) pi^_i, drawn anew at each step
              D <- D + {(s, pi*(s)) of these visits}
              pi^_{i+1} = the clone of D, in the class of the cloning learner
    at last   the best of the pi^
With `labels="clean"` the visits are those of the expert under noise (DART), and the labels its own. With `labels="gated"` the
learner acts until the oracle takes over, and only what it does then is learned (HG-DAgger; Kelly et al. 2019). With
`cost="advantage"` labels have the prices of `prices` (AggreVaTe).
Best is, where the table is known: of the highest value, exactly, if the reward is known; else with the fewest steps at odds
    odds(pi) = sum_s d_pi(s) (1 - pi(pi*(s) | s)),   a step in a state without a label counting whole,
which is what the oracle's value is more than pi's at most, in units of the most that one other action costs (its advantage,
summed along d_pi). With odds of 0, if it asks only where nothing was answered yet, nothing is left to learn, and it ends.
Axes: S states, A actions.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import gymnasium as gym
import numpy as np

from irl_gym._typing import Matrix
from irl_gym.checks import checked_number, discrete_actions, is_word
from irl_gym.environments.closing import close
from irl_gym.environments.rollouts import maker_of
from irl_gym.errors import InvalidParameter, NotDiscrete, a_type
from irl_gym.learners.base import Outcome, featured
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.interactive.answers import Noted
from irl_gym.learners.interactive.classes import OfObservations, OfRows, PolicyClass, check_clones
from irl_gym.learners.interactive.labels import Asking, Labels
from irl_gym.learners.interactive.prices import prices
from irl_gym.learners.interactive.proofs import DaggerProof
from irl_gym.learners.interactive.visits import LabelledVisits, drawn_visits, exact_visits, reached, stepped_visits
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.learners.registry import learner_of
from irl_gym.mdp.planning.dynamic_programming import occupancy
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.killable import within
from irl_gym.programs.status import Status
from irl_gym.records import Record
from irl_gym.spaces.states import StateIndex, States

Schedule = Literal["indicator", "linear", "exponential"]
Whence = Literal["own", "clean", "gated"]
Costs = Literal["mistakes", "advantage"]


@dataclass(frozen=True, eq=False)
class Round(Record):
    """A round: where it came to, and what was learned then."""

    beta: float
    """Share of the steps in which the oracle's action was taken."""
    visits: LabelledVisits
    """What was visited and labelled in this round."""
    policy: Any
    """(S, A) the clone of all labels so far; of a network, what has `predict`."""
    queries: int
    """So far."""
    mistakes: float
    """The share of these visits which the policy before labels otherwise: before it learned from them."""
    value: float | None
    """Of the policy, exactly; None where the table or the reward is not known."""
    odds: float | None
    """Discounted steps that it is at odds with the oracle, at most; None where there is no table."""
    acting: float | None
    """Discounted steps that it makes; None where there is no table."""
    contradicted: int
    """States in which the oracle did not always answer the same, so far."""
    labelled: int | None
    """States in which it answered, so far; None where they are not numbered."""


@dataclass(frozen=True, eq=False)
class DAgger:
    """Dataset aggregation.

    Raises:
        InvalidParameter: a field outside its range, or a learner that clones no labels.
        UnknownLearner: a learner's name that is none.
    """

    rounds: int = 10
    """At most; fewer with `ask="unseen"` where nothing is left to learn."""
    learner: Any = field(default_factory=Clone)
    """Clones the labels: `Clone(...)`, `SoftmaxClone(...)` or `NeuralClone(...)`, whose fields make the class; or its name."""
    beta: Schedule = "indicator"
    """beta_i: 1 in the first round and 0 later; from 1 to 0 linearly; or decay^(i - 1)."""
    decay: float = 0.5
    """Of the exponential schedule, between 0 and 1."""
    episodes: int | None = None
    """Episodes a round, of the table or, where there is none, of the environment. None: no episodes, but d exactly, of a table,
    discounted, by one sparse solve a round."""
    max_episode_steps: int = 500
    """Longer episodes are cut."""
    labels: Whence = "own"
    """Of states to which the mixture comes, more and more the learner's own; or clean ones of states to which the expert comes
    under `noise`, in every round, whatever beta: the learner never acts (DART; Laskey et al. 2017, with a noise that stays); or
    gated: after a first round that is the oracle's, whatever beta, the learner acts until the oracle's `gate` takes over."""
    noise: float = 0.1
    """Of `labels="clean"`: probability of a random action in place of the expert's, between 0 and 1."""
    ask: Asking = "always"
    """Ask at each visit, or only in states in which the oracle has not answered yet; its answer then serves at each visit."""
    cost: Costs = "mistakes"
    """What is minimised: mistakes; or what they cost, by the advantages of an oracle that is a table, under the true reward."""
    time_limit: float | None = None
    """Seconds for all rounds together, asked for at each query, step and iteration; None for no limit. What the oracle does
    with a query is not cut."""
    needs: ClassVar[Needs] = Needs(("oracle", "dynamics or environment"), ("reward", "features"))
    """The parts of a problem that `learn` reads; the reward tells which round is the best, and what mistakes cost."""
    resumes: ClassVar[bool] = True
    """`learn` takes a folder, and goes on where it was."""

    def __post_init__(self) -> None:
        checked_number("rounds", self.rounds, "a whole number of at least 1", least=1, whole=True)
        checked_number("decay", self.decay, "a number between 0 and 1, such as 0.5", above=0, below=1)
        checked_number("noise", self.noise, "a number between 0 and 1, such as 0.1", above=0, below=1)
        checked_number("max_episode_steps", self.max_episode_steps, "a whole number of at least 1", least=1, whole=True)
        if self.episodes is not None:
            checked_number("episodes", self.episodes, "a whole number of at least 1, or None", least=1, whole=True)
        words = {"beta": Schedule, "ask": Asking, "labels": Whence, "cost": Costs}
        for name, known in words.items():
            if not is_word(getattr(self, name), *get_args(known)):
                raise InvalidParameter(f"{name} is {getattr(self, name)!r:.60}: expected one of {', '.join(get_args(known))}.")
        Deadline.after(self.time_limit)  # checks it
        if isinstance(self.learner, str):
            object.__setattr__(self, "learner", learner_of(self.learner, {}))
        check_clones(self.learner, priced=self.cost == "advantage", sampled=self.episodes is not None)

    @property
    def on_rows(self) -> bool:
        """Is its policy one of numbered states, so that without them there is none?"""
        return bool(getattr(self.learner, "on_rows", False))

    @property
    def how(self) -> str:
        """How its policy comes about."""
        where = {"own": "where it went itself (DAgger)", "clean": "where the expert went under noise (DART)",
                 "gated": "where it took over from the learner (HG-DAgger)"}[self.labels]  # fmt: skip
        priced = ", at the price of mistakes (AggreVaTe)" if self.cost == "advantage" else ""
        return f"cloned from the oracle's answers {where}{priced}"

    def share(self, number: int) -> float:
        """The oracle's share of the steps of round i, from 1; where it is gated, of those in which it has no choice."""
        if self.labels == "clean":
            return 1 - self.noise
        if self.beta == "linear" and self.labels == "own":
            return 1.0 if self.rounds == 1 else 1 - (number - 1) / (self.rounds - 1)
        own = self.beta == "indicator" or self.labels == "gated"
        return float(number == 1) if own else float(self.decay ** (number - 1))

    def learn(
        self, problem: Problem, rng: np.random.Generator, folder: Path | None = None, stage: gym.Env | None = None
    ) -> Outcome[None, DaggerProof]:
        """The best round's policy, (S, A) or of a network; and in `labelled` the episodes, where there are some.

        Args:
            problem: with an oracle, and a table or an environment; with features, if the learner is to have the problem's.
            rng: of episodes.
            folder: where answers and policies are kept, round by round: what finds them there goes on from them
                (`irl_gym.learners.interactive.answers`). None for nowhere.
            stage: what is stepped, such as an environment that a person looks at, without a table; None for a copy.

        Raises:
            MissingPart: one of these is not there.
            NotDiscrete: observations that cannot be numbered, or actions that are not one number.
            InvalidParameter: no table and no number of episodes; no gate, or no prices, where these are asked for.
            InvalidPolicy: the oracle's answer is no action.
            RunConflict: the folder holds answers to other questions.
            SolverTimeout: the time is up.
        """
        played = [*self.iterate(problem, rng, folder, stage)]
        by, merits = "last", np.arange(len(played), dtype=float)
        if played[0].value is not None:
            by, merits = "value", np.array([one.value for one in played], dtype=float)
        elif played[0].odds is not None:
            by, merits = "odds", -np.array([one.odds for one in played], dtype=float)
        best = int(merits.argmax())
        kept, last = played[best], played[-1]
        episodes = tuple(one for each in played for one in each.visits.episodes)
        proof = DaggerProof(
            last.queries, len(played), int(self.rounds), last.labelled, last.contradicted,
            None if self.episodes is None else sum(map(len, episodes)), best + 1, by, kept.value, kept.odds, kept.acting,
            last.mistakes,
        )  # fmt: skip
        each = ("beta", "queries", "mistakes", "value", "odds")
        stats = {"rounds": [{name: getattr(one, name) for name in each} for one in played]}
        return Outcome(None, Status.LEARNED, proof, stats, kept.policy, episodes or None)

    def iterate(
        self, problem: Problem, rng: np.random.Generator, folder: Path | None = None, stage: gym.Env | None = None
    ) -> Iterator[Round]:
        """A round at a time; arguments and errors as `learn`."""
        deadline = Deadline.after(self.time_limit)
        known: Any = self.needs.of(problem, self)
        A = int(discrete_actions(known.spaces.actions).n)
        mdp = known.dynamics if isinstance(known.dynamics, TabularMDP) else None
        states = self._states(known)
        if self.labels == "gated" and known.oracle.gate is None:
            raise InvalidParameter(
                "labels is 'gated', and the oracle has no gate: expected one that says where it takes over, "
                "`Oracle(policy, gate=...)`. Or use labels='own'."
            )
        clones = self._clones(known, mdp, states, A, folder)
        env = stage if stage is not None else self._steppable(known) if mdp is None else None
        oracle = known.oracle if folder is None else Noted(known.oracle, Path(folder))
        labels = Labels(oracle, states, A, self.ask, gated=self.labels == "gated")
        policy: Any = clones.first()
        chance = policy
        try:
            for number in range(1, self.rounds + 1):
                beta = self.share(number)
                with within(deadline):
                    acting = chance if self.labels == "clean" else policy
                    visits = self._visits(known, mdp, env, clones, acting, beta, labels, rng, number)
                    mistakes = clones.mistakes(policy, visits)
                    policy = clones.learned(visits, rng)
                    matrix = None if mdp is None else clones.matrix(policy)
                    judged = (None, None, None) if matrix is None else _judged(mdp, matrix, known.reward, labels.shares)
                yield Round(beta, visits, policy, labels.queries, mistakes, *judged, labels.contradicted, labels.labelled)
                if judged[1] == 0 and self.ask == "unseen":
                    return
        finally:
            if env is not None:
                close(env)

    def _visits(
        self, known: Problem, mdp: TabularMDP | None, env: gym.Env | None, clones: PolicyClass, policy: Any, beta: float,
        labels: Labels, rng: np.random.Generator, number: int,
    ) -> LabelledVisits:  # fmt: skip
        """A round, played."""
        n, most = self.episodes, self.max_episode_steps
        if mdp is None:
            assert env is not None and n is not None
            return stepped_visits(env, lambda *seen: clones.act(policy, *seen), beta, labels, n, most, rng, number)
        if n is None:
            return exact_visits(mdp, clones.matrix(policy), beta, labels)
        return drawn_visits(mdp, clones.matrix(policy), beta, labels, n, most, rng, known.reward, number)

    def _states(self, known: Problem) -> States | None:
        """Who numbers observations; None where a network learns from such as cannot be.

        Raises:
            NotDiscrete: they cannot be numbered, and have to be.
        """
        try:
            return known.spaces.states or StateIndex(known.spaces.observations)
        except NotDiscrete:
            if self.on_rows or self.ask == "unseen":
                raise
            return None

    def _clones(
        self, known: Problem, mdp: TabularMDP | None, states: States | None, A: int, folder: Path | None
    ) -> PolicyClass:
        if not self.on_rows:
            return OfObservations(self.learner, known.spaces, states, A, folder)
        assert states is not None
        learner: Any = featured(self.learner, known) if "features" in self.learner.needs.parts else self.learner
        priced = prices(known.oracle, mdp, known.reward) if self.cost == "advantage" else None
        return OfRows(learner, mdp, known.spaces, (states.n_states, A), priced, folder)

    def _steppable(self, known: Problem) -> gym.Env:
        """A copy of the environment of a problem without a table.

        Raises:
            InvalidParameter: the world has none, or the number of episodes is missing.
        """
        world = known.environment if known.dynamics is None else known.dynamics
        env = getattr(world, "env", None)
        if not isinstance(env, gym.Env):
            raise InvalidParameter(f"the environment is {a_type(world)} without `env`: expected one that can be stepped.")
        if self.episodes is None:
            raise InvalidParameter(
                "episodes is None, and there is no table: expected a number of episodes a round. Give `episodes`, such as 20."
            )
        return maker_of(env)()


def _judged(mdp: Any, policy: Matrix, reward: Any, shares: Matrix) -> tuple[float | None, float, float]:
    """Value, None without a reward; discounted steps at odds with the oracle, at most; and all discounted steps."""
    mu = np.maximum(occupancy(mdp, policy), 0.0) * reached(mdp, lambda rows: policy[rows])[:, None]
    visits = mu.sum(axis=1)
    odds = float(visits @ np.maximum(1 - (policy * shares).sum(axis=1), 0.0))
    return None if reward is None else float((mu * reward.expected(mdp)).sum()), odds, float(visits.sum())
