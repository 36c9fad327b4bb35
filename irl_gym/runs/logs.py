"""What training leaves as it goes on: checkpoints, and logs as TensorBoard reads them, a run's learning curve beside them.

Event files hold the time and the host's name, so the same seed does not give the same bytes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv

from irl_gym.agents.checkpoints import Checkpoint
from irl_gym.agents.planners import SB3, Agent, FirstWeights, Planner, Progress


@dataclass(frozen=True)
class Logged:
    """SB3 with a log and a checkpoint. They are no fields of SB3, so that the configuration of a run says nothing of them."""

    planner: SB3
    """Trains."""
    log: Path
    """Folder of TensorBoard's files."""
    checkpoint: Checkpoint
    """Where the training is kept while it is under way."""
    start: FirstWeights | None
    """Gives its first weights to who is trained; None for random ones."""

    def plan(self, env: gym.Env | VecEnv, *, gamma: float, seed: int = 0, progress: Progress | None = None) -> Agent:
        """Train a new agent, or go on with one."""
        kept = {"log": self.log, "checkpoint": self.checkpoint, "start": self.start}
        return self.planner.plan(env, gamma=gamma, seed=seed, progress=progress, **kept)


def logged(planner: Planner, log: Path, checkpoint: Checkpoint, start: FirstWeights | None = None) -> Planner:
    """The planner, with a log, a checkpoint and a start of its training if it trains."""
    return Logged(planner, log, checkpoint, start) if isinstance(planner, SB3) else planner


def log_scalars(log: Path, steps: np.ndarray, scalars: Mapping[str, np.ndarray]) -> None:
    """Add curves to a log, through SB3's logger: by name, (n,) numbers, one for each of the environment steps (n,)."""
    logger = configure(str(log), ["tensorboard"])
    for i, step in enumerate(steps.tolist()):
        for name, values in scalars.items():
            logger.record(name, float(values[i]))
        logger.dump(int(step))
    logger.close()
