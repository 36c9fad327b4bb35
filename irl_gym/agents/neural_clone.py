"""Behaviour cloning by a network of Stable-Baselines3: any observations and actions that it takes, and PPO can go on from it.

    minimise -sum_i w_i log pi(a_i | s_i) / sum_i w_i      by Adam, in minibatches; w_i = 1, or 1 / how often a_i was taken
A share of the episodes is held out; training ends when their loss has not become less for `patience` epochs, and the weights of
the best epoch are kept. The family is `irl_gym.learners.cloning`; torch keeps this one here. It is `neural_training` that
imports torch, when a network is made: to read what the learner needs costs none. Axes: N steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from gymnasium import spaces

from irl_gym.agents.neural_labels import FitsLabels
from irl_gym.agents.neural_proof import Epoch, NeuralProof
from irl_gym.checks import checked_number, discrete_actions, is_word
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.learners.base import Outcome
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.killable import within
from irl_gym.spaces.batches import batch_sizes, take

if TYPE_CHECKING:
    from stable_baselines3 import PPO


@dataclass(frozen=True)
class NeuralClone(FitsLabels):
    """Behaviour cloning by a network of Stable-Baselines3, kept as an agent of PPO.

    Raises:
        InvalidParameter: a field outside its range.
    """

    net_arch: tuple[int, ...] | None = None
    """Hidden layers; None for none where observations are numbers, which are one-hot, else SB3's own. Images of 36 x 36 pixels
    and more are read by SB3's convolutions first."""
    epochs: int = 100
    """Passes over the steps, at most."""
    batch_size: int = 128
    """Steps of a minibatch."""
    learning_rate: float | None = None
    """Of Adam; None for 0.03 without hidden layers or convolutions, else 0.001."""
    held_out: float = 0.1
    """Share of the episodes, between 0 and 1, by which training is stopped; of a single episode, of its steps; 0 for none."""
    patience: int = 10
    """Epochs without a smaller loss of what is held out, after which training ends."""
    weights: Literal["equal", "balanced"] = "equal"
    """What a step counts; balanced: each action as much as any other, of discrete actions."""
    device: str = "cpu"
    """Where the network is: cpu, cuda, or what torch calls others."""
    time_limit: float | None = None
    """Seconds for the whole fit, asked for at each minibatch; None for no limit."""
    needs: ClassVar[Needs] = Needs(("demonstrations",))
    """The parts of a problem that `learn` reads."""
    how: ClassVar[str] = "cloned from the episodes, by a network"
    """How its policy comes about."""

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_size", "patience"):
            checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)
        for size in self.net_arch or ():
            checked_number("net_arch", size, "sizes of at least 1", least=1, whole=True)
        if self.learning_rate is not None:
            checked_number("learning_rate", self.learning_rate, "a number above 0, or None", above=0)
        Deadline.after(self.time_limit)  # checks it
        checked_number("held_out", self.held_out, "a share of at least 0, below 1", least=0, below=1)
        if not is_word(self.weights, "equal", "balanced"):
            raise InvalidParameter(f"weights is {self.weights!r}: expected 'equal' or 'balanced'.")
        from irl_gym.agents.neural_training import check_device

        check_device(self.device)

    def learn(
        self, problem: Problem, rng: np.random.Generator, on_epoch: Epoch | None = None, model: "PPO | None" = None
    ) -> Outcome[None, NeuralProof]:
        """The same as `fit`, of a problem; where SB3 takes no such observations it is shown the rows of the table.

        Raises:
            MissingPart: there are no demonstrations. And whatever `fit` raises.
            NotDiscrete: actions that are not one number.
        """
        known = self.needs.of(problem, self)
        episodes: Any = known.demonstrations
        parts = [take(one.observations, slice(None, -1)) for one in episodes]
        taken = [one.taken(f"episode {i}") for i, one in enumerate(episodes)]
        return self.fit_labels(parts, taken, known.spaces, rng, on_epoch, model)

    def fit(
        self, observations: Any, actions: Any, observation_space: spaces.Space, action_space: spaces.Space, *,
        lengths: Sequence[int] | None = None, rng: np.random.Generator | None = None, on_epoch: Epoch | None = None,
        log: Path | None = None, model: "PPO | None" = None,
    ) -> Outcome[None, NeuralProof]:  # fmt: skip
        """Clone the steps of episodes.

        Args:
            observations: N, stacked as vector environments stack them.
            actions: (N, ...) what was done in each; discrete ones from 0.
            observation_space: any that SB3 takes.
            action_space: Discrete, MultiDiscrete, MultiBinary or Box.
            lengths: of the episodes, one after the other; None for one episode.
            rng: of the first weights, of what is held out and of minibatches; None for seed 0.
            on_epoch: called after each epoch.
            log: folder for the losses as TensorBoard reads them; None for no log.
            model: an agent of PPO or A2C whose policy becomes the clone, so that it goes on from there; None for a new one.

        Raises:
            InvalidDemonstrations: no step, parts of other lengths, or actions outside the space.
            InvalidParameter: balanced weights of actions that are not Discrete.
            SolverTimeout: the time is up.
        """
        from irl_gym.agents.neural_training import trained

        deadline = Deadline.after(self.time_limit)
        rng = np.random.default_rng(0) if rng is None else rng
        taken = _checked(observations, actions, action_space)
        each = np.array([len(taken)] if lengths is None else lengths)
        if each.sum() != len(taken):
            raise InvalidDemonstrations(f"the lengths add up to {each.sum()}: expected {len(taken)}, the number of steps.")
        model = self._model(observation_space, action_space, rng) if model is None else model
        with within(deadline):
            return trained(
                model, observations, taken, self._out(each, rng), self._counts(taken, action_space),
                rate=self.learning_rate, epochs=self.epochs, batch_size=self.batch_size, patience=self.patience, rng=rng,
                on_epoch=on_epoch, log=log,
            )  # fmt: skip

    def _model(self, observations: spaces.Space, actions: spaces.Space, rng: np.random.Generator) -> "PPO":
        """A new network."""
        from irl_gym.agents.neural_training import untrained

        return untrained(observations, actions, self.net_arch, int(rng.integers(2**31)), self.device)

    def _out(self, each: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """(N,) the steps that are held out: of whole episodes, where there are several."""
        if len(each) == 1:
            return rng.permutation(int(each[0])) < int(self.held_out * each[0])
        n = min(len(each) - 1, max(1, round(self.held_out * len(each)))) if self.held_out else 0
        return np.repeat(rng.permutation(len(each)) < n, each)

    def _counts(self, taken: np.ndarray, actions: spaces.Space) -> np.ndarray:
        """(N,) what each step counts, 1 on average."""
        if self.weights == "equal":
            return np.ones(len(taken))
        often = np.bincount(taken, minlength=int(discrete_actions(actions, error=InvalidParameter).n))
        return len(taken) / (np.count_nonzero(often) * often[taken])


def _checked(observations: Any, actions: Any, space: spaces.Space) -> np.ndarray:
    """(N, ...) the actions."""
    taken = np.asarray(actions)
    if not len(taken) or {*batch_sizes(observations)} != {len(taken)}:
        raise InvalidDemonstrations(
            f"there are {len(taken)} actions of {batch_sizes(observations)} observations: expected as many, and at least one."
        )
    taken = taken.astype(np.float32 if isinstance(space, spaces.Box) else np.int64)
    if isinstance(space, spaces.Box):
        low, high = space.low, space.high
    else:
        most = {spaces.Discrete: "n", spaces.MultiDiscrete: "nvec"}.get(type(space))
        low, high = np.zeros(1), np.ones(1) if most is None else getattr(space, most) - 1
    shaped = taken.shape[1:] == space.shape
    wrong = np.argwhere(~((taken >= low) & (taken <= high))) if shaped else [[0]]  # NaN too
    if len(wrong):
        raise InvalidDemonstrations(f"action {wrong[0][0]} is {taken[wrong[0][0]]}: expected one of {space}, discrete from 0.")
    return taken


def _continuous(space: spaces.Space) -> bool:
    return isinstance(space, spaces.Box)
