"""The network of `neural_clone`: made as Stable-Baselines3 makes it, and trained by Adam. Axes: N steps."""

import copy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger, configure
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.torch_layers import NatureCNN

from irl_gym.agents.neural_proof import Epoch, NeuralProof
from irl_gym.agents.planners import Agent, torch_threads
from irl_gym.errors import InvalidParameter
from irl_gym.learners.base import Outcome
from irl_gym.programs.killable import check_limit
from irl_gym.programs.status import Status

LEAST_IMAGE = 36
"""Pixels along each side that SB3's convolutions need."""


class _Nowhere(gym.Env):
    """Spaces without a world, which is what SB3 makes a network from."""

    def __init__(self, observations: spaces.Space, actions: spaces.Space):
        self.observation_space, self.action_space = observations, actions


def check_device(name: str) -> None:
    """Check where a network is to be.

    Raises:
        InvalidParameter: nothing that torch knows.
    """
    try:
        torch.device(name)
    except (RuntimeError, TypeError) as error:
        raise InvalidParameter(f"device is {name!r}: expected a name that torch knows, such as cpu or cuda.") from error


def untrained(
    observations: spaces.Space, actions: spaces.Space, net_arch: tuple[int, ...] | None, seed: int, device: str
) -> PPO:
    """An agent of PPO that was never trained."""
    kind = "MultiInputPolicy" if isinstance(observations, spaces.Dict) else "MlpPolicy"
    if is_image_space(observations) and min(sorted(observations.shape or ())[-2:]) >= LEAST_IMAGE:
        kind = "CnnPolicy"
    layers = [] if net_arch is None and isinstance(observations, spaces.Discrete) else net_arch
    network = {} if layers is None else {"net_arch": list(layers)}
    model = PPO(kind, _Nowhere(observations, actions), policy_kwargs=network, seed=seed, device=device)
    model.set_logger(Logger(None, []))  # SB3's own leaves a folder in the temporary one
    return model


@torch_threads(1)
def trained(
    model: PPO, observations: Any, taken: np.ndarray, out: np.ndarray, weights: np.ndarray, *, rate: float | None, epochs: int,
    batch_size: int, patience: int, rng: np.random.Generator, on_epoch: Epoch | None, log: Path | None,
) -> Outcome[None, NeuralProof]:  # fmt: skip
    """Clone steps.

    Args:
        model: whose network is trained.
        observations: N, stacked as vector environments stack them.
        taken: (N, ...) what was done in each.
        out: (N,) the steps that are held out.
        weights: (N,) what each step counts.
        rate: of Adam; None for 0.03 without hidden layers or convolutions, else 0.001.
        epochs: as `NeuralClone` has them, and the next two.
        batch_size: steps of a minibatch.
        patience: epochs without a smaller loss.
        rng: of minibatches.
        on_epoch: as its `fit` takes it.
        log: the same.
    """
    network = model.policy
    seen, _ = network.obs_to_tensor(observations)
    targets = torch.as_tensor(taken, device=network.device)
    if isinstance(network.action_space, spaces.MultiBinary):
        targets = targets.float()  # as torch's Bernoulli takes them
    counts = torch.as_tensor(weights, dtype=torch.float32, device=network.device)
    parts = [torch.as_tensor(np.flatnonzero(mask), device=network.device) for mask in (~out, out)]
    acting = [p for name, p in network.named_parameters() if "value" not in name]
    adam = torch.optim.Adam(acting, lr=_rate(model) if rate is None else rate)

    def loss(which: torch.Tensor) -> torch.Tensor:
        check_limit()
        log_pi = network.get_distribution(_at(seen, which)).log_prob(targets[which])
        return -(counts[which] * log_pi).sum() / counts[which].sum()

    @torch.no_grad()
    def mean(which: torch.Tensor) -> float:
        blocks = which.split(1 << 14)
        shares = [float(counts[one].sum()) for one in blocks]
        return float(np.average([float(loss(one)) for one in blocks], weights=shares)) if shares[0] else float("nan")

    written = None if log is None else configure(str(log), ["tensorboard"])
    best, kept, fitted, epoch = np.inf, 0, copy.deepcopy(network.state_dict()), 0
    for epoch in range(1, epochs + 1):
        network.set_training_mode(True)
        order, found = parts[0][torch.as_tensor(rng.permutation(len(parts[0])))], []
        for which in order.split(batch_size):
            value = loss(which)
            adam.zero_grad()
            value.backward()
            torch.nn.utils.clip_grad_norm_(acting, 10.0)
            adam.step()
            found.append(float(value.detach()))
        network.set_training_mode(False)
        judged = mean(parts[1])
        _tell(written, on_epoch, epoch, float(np.mean(found)), judged)
        if np.isnan(judged) or judged < best:
            best, kept, fitted = judged, epoch, copy.deepcopy(network.state_dict())
        elif epoch - kept >= patience:
            break
    network.load_state_dict(fitted)
    if written is not None:
        written.close()
    error = _error(network, _at(seen, parts[1]), taken[out])
    size = sum(p.numel() for p in acting)
    told = {"held_out_loss": mean(parts[1]), "held_out_error": error, "parameters": size, "loss": mean(parts[0])}
    proof = NeuralProof(int((~out).sum()), int(out.sum()), epoch, kept, continuous=_continuous(network.action_space), **told)
    return Outcome(None, Status.LEARNED, proof, {"epochs": epoch}, Agent(model))


def _rate(model: PPO) -> float:
    network = model.policy
    return 0.03 if network.net_arch == [] and not isinstance(network.features_extractor, NatureCNN) else 1e-3


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
