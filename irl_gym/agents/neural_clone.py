"""Behaviour cloning by a network of Stable-Baselines3: any observations and actions that it takes, and PPO can go on from it.

    minimise -sum_i w_i log pi(a_i | s_i) / sum_i w_i      by Adam, in minibatches; w_i = 1, or 1 / how often a_i was taken
A share of the episodes is held out; training ends when their loss has not become less for `patience` epochs, and the weights of
the best epoch are kept. The family is `irl_gym.learners.cloning`; torch keeps this one here. Axes: N steps.
"""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger, configure

from irl_gym.agents.neural_proof import NeuralProof
from irl_gym.agents.planners import Agent, torch_threads
from irl_gym.checks import checked_number, discrete_actions, is_word
from irl_gym.environments.tabular_vec_env import shows_rows
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.learners.base import Outcome
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.programs.status import Status
from irl_gym.spaces.batches import batch_sizes, by_part, take

Epoch = Callable[[int, float, float], None]
"""Called after each epoch with its number from 1, the mean loss of its minibatches, and that of what is held out, or NaN."""


class _Nowhere(gym.Env):
    """Spaces without a world, which is what SB3 makes a network from."""

    def __init__(self, observations: spaces.Space, actions: spaces.Space):
        self.observation_space, self.action_space = observations, actions


@dataclass(frozen=True)
class NeuralClone:
    """Behaviour cloning by a network of Stable-Baselines3, kept as an agent of PPO.

    Raises:
        InvalidParameter: a field outside its range.
    """

    net_arch: tuple[int, ...] | None = None
    """Hidden layers; None for none where observations are numbers, which are one-hot, else SB3's own."""
    epochs: int = 100
    """Passes over the steps, at most."""
    batch_size: int = 128
    """Steps of a minibatch."""
    learning_rate: float | None = None
    """Of Adam; None for 0.03 without hidden layers, else 0.001."""
    held_out: float = 0.1
    """Share of the episodes, between 0 and 1, by which training is stopped; of a single episode, of its steps; 0 for none."""
    patience: int = 10
    """Epochs without a smaller loss of what is held out, after which training ends."""
    weights: Literal["equal", "balanced"] = "equal"
    """What a step counts; balanced: each action as much as any other, of discrete actions."""
    device: str = "cpu"
    """Where the network is: cpu, cuda, or what torch calls others."""
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
        checked_number("held_out", self.held_out, "a share of at least 0, below 1", least=0, below=1)
        if not is_word(self.weights, "equal", "balanced"):
            raise InvalidParameter(f"weights is {self.weights!r}: expected 'equal' or 'balanced'.")
        try:
            torch.device(self.device)
        except (RuntimeError, TypeError) as error:
            raise InvalidParameter(
                f"device is {self.device!r}: expected a name that torch knows, such as cpu or cuda."
            ) from error

    def learn(self, problem: Problem, rng: np.random.Generator) -> Outcome[None, NeuralProof]:
        """The same as `fit`, of a problem; where SB3 takes no such observations it is shown the rows of the table.

        Raises:
            MissingPart: there are no demonstrations. And whatever `fit` raises.
            NotDiscrete: actions that are not one number.
        """
        known = self.needs.of(problem, self)
        episodes: Any = known.demonstrations
        states, actions = known.spaces.states, spaces.Discrete(int(discrete_actions(known.spaces.actions).n))
        if states is not None and shows_rows(states):
            space: spaces.Space = spaces.Discrete(states.n_states)
            seen: Any = np.concatenate([one.rows(states)[:-1] for one in episodes])
        else:
            states, space = None, known.spaces.observations
            parts = [take(one.observations, slice(None, -1)) for one in episodes]
            seen = by_part(lambda *arrays: np.concatenate(arrays), *parts)
        taken, lengths = (
            np.concatenate([one.taken(f"episode {i}") for i, one in enumerate(episodes)]),
            [len(one) for one in episodes],
        )
        found = self.fit(seen, taken, space, actions, lengths=lengths, rng=rng)
        return Outcome(None, found.status, found.proof, found.stats, Agent(found.policy.model, states))

    def fit(
        self, observations: Any, actions: Any, observation_space: spaces.Space, action_space: spaces.Space, *,
        lengths: Sequence[int] | None = None, rng: np.random.Generator | None = None, on_epoch: Epoch | None = None,
        log: Path | None = None,
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

        Raises:
            InvalidDemonstrations: no step, parts of other lengths, or actions outside the space.
            InvalidParameter: balanced weights of actions that are not Discrete.
        """
        rng = np.random.default_rng(0) if rng is None else rng
        taken = _checked(observations, actions, action_space)
        each = np.array([len(taken)] if lengths is None else lengths)
        if each.sum() != len(taken):
            raise InvalidDemonstrations(f"the lengths add up to {each.sum()}: expected {len(taken)}, the number of steps.")
        model = self._model(observation_space, action_space, rng)
        with torch_threads(1):
            return self._fitted(observations, taken, each, model, rng, on_epoch, log)

    def _fitted(
        self, observations: Any, taken: np.ndarray, each: np.ndarray, model: PPO, rng: np.random.Generator,
        on_epoch: Epoch | None, log: Path | None,
    ) -> Outcome[None, NeuralProof]:  # fmt: skip
        network = model.policy
        out = self._out(each, rng)
        seen, _ = network.obs_to_tensor(observations)
        targets = torch.as_tensor(taken, device=network.device)
        counts = torch.as_tensor(self._counts(taken, network.action_space), dtype=torch.float32, device=network.device)
        parts = [torch.as_tensor(np.flatnonzero(mask), device=network.device) for mask in (~out, out)]
        acting = [p for name, p in network.named_parameters() if "value" not in name]
        adam = torch.optim.Adam(acting, lr=self._rate(model))

        def loss(which: torch.Tensor) -> torch.Tensor:
            log_pi = network.get_distribution(_at(seen, which)).log_prob(targets[which])
            return -(counts[which] * log_pi).sum() / counts[which].sum()

        @torch.no_grad()
        def mean(which: torch.Tensor) -> float:
            blocks = which.split(1 << 14)
            shares = [float(counts[one].sum()) for one in blocks]
            return float(np.average([float(loss(one)) for one in blocks], weights=shares)) if shares[0] else float("nan")

        written = None if log is None else configure(str(log), ["tensorboard"])
        best, kept, weights, epoch = np.inf, 0, copy.deepcopy(network.state_dict()), 0
        for epoch in range(1, self.epochs + 1):
            network.set_training_mode(True)
            order, found = parts[0][torch.as_tensor(rng.permutation(len(parts[0])))], []
            for which in order.split(self.batch_size):
                value = loss(which)
                adam.zero_grad()
                value.backward()
                torch.nn.utils.clip_grad_norm_(acting, 10.0)
                adam.step()
                found.append(float(value.detach()))
            network.set_training_mode(False)
            trained, judged = float(np.mean(found)), mean(parts[1])
            _tell(written, on_epoch, epoch, trained, judged)
            if np.isnan(judged) or judged < best:
                best, kept, weights = judged, epoch, copy.deepcopy(network.state_dict())
            elif epoch - kept >= self.patience:
                break
        network.load_state_dict(weights)
        if written is not None:
            written.close()
        error = _error(network, _at(seen, parts[1]), taken[out])
        size = sum(p.numel() for p in acting)
        told = {"held_out_loss": mean(parts[1]), "held_out_error": error, "parameters": size, "loss": mean(parts[0])}
        proof = NeuralProof(
            int((~out).sum()), int(out.sum()), epoch, kept, continuous=_continuous(network.action_space), **told
        )
        return Outcome(None, Status.LEARNED, proof, {"epochs": epoch}, Agent(model))

    def _model(self, observations: spaces.Space, actions: spaces.Space, rng: np.random.Generator) -> PPO:
        """An agent of PPO that was never trained."""
        kind = "MultiInputPolicy" if isinstance(observations, spaces.Dict) else "MlpPolicy"
        layers = [] if self.net_arch is None and isinstance(observations, spaces.Discrete) else self.net_arch
        network = {} if layers is None else {"net_arch": list(layers)}
        seed = int(rng.integers(2**31))
        model = PPO(kind, _Nowhere(observations, actions), policy_kwargs=network, seed=seed, device=self.device)
        model.set_logger(Logger(None, []))  # SB3's own leaves a folder in the temporary one
        return model

    def _rate(self, model: PPO) -> float:
        if self.learning_rate is not None:
            return self.learning_rate
        return 0.03 if model.policy.net_arch == [] else 1e-3

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
    taken = taken.astype(np.float32 if _continuous(space) else np.int64)
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


def _at(seen: Any, which: torch.Tensor) -> Any:
    return {key: one[which] for key, one in seen.items()} if isinstance(seen, dict) else seen[which]


def _error(network: Any, seen: Any, taken: np.ndarray) -> float:
    """How far the deterministic actions are from those taken."""
    if not len(taken):
        return float("nan")
    with torch.no_grad():
        chosen = network.get_distribution(seen).get_actions(deterministic=True).cpu().numpy().reshape(len(taken), -1)
    apart = taken.reshape(len(taken), -1) - chosen
    return float(np.linalg.norm(apart, axis=1).mean() if _continuous(network.action_space) else (apart != 0).any(axis=1).mean())


def _tell(log: Logger | None, on_epoch: Epoch | None, epoch: int, trained: float, judged: float) -> None:
    if log is not None:
        log.record("clone/loss", trained)
        log.record("clone/held_out_loss", judged)
        log.dump(epoch)
    if on_epoch is not None:
        on_epoch(epoch, trained, judged)
