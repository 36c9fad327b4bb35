"""Clone the steps of a file by one of two libraries, and keep the weights as they come with the processor time up to then.

    python scripts/clone_timed.py ours|imitation steps.npz found.npz EPOCHS SEED

`measure_cloning.py` runs it in an environment of each library, so it imports nothing of either before it knows which. Weights
are seen by a hook of torch after every tenth update, whose own time is taken off. Same network (32-32, tanh), batches of 32,
Adam at 0.001; what imitation does besides by default (an entropy bonus of 0.001) it does here. Axes: N steps, K snapshots.
"""

import contextlib
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from torch.optim.optimizer import register_optimizer_step_post_hook

EVERY = 10
"""Updates between two snapshots."""


class Snapshots:
    """The weights of whatever is optimised, with the processor time that was spent since it began."""

    def __init__(self, acting: Callable[[], Iterable[bool]] | None = None):
        self._acting, self._taken, self._updates = acting, 0.0, 0
        self.seconds: list[float] = []
        self.weights: list[np.ndarray] = []
        self._began = time.process_time()

    def see(self, optimizer: Any, *_: Any) -> None:
        """After an update."""
        self._updates += 1
        if self._updates % EVERY:
            return
        now = time.process_time()
        self.seconds.append(now - self._began - self._taken)
        every = [one for group in optimizer.param_groups for one in group["params"]]
        kept = every if self._acting is None else [p for p, acts in zip(every, self._acting(), strict=True) if acts]
        self.weights.append(np.concatenate([one.detach().numpy().ravel() for one in kept]))
        self._taken += time.process_time() - now


@contextlib.contextmanager
def watched(kept: Snapshots) -> Iterator[None]:
    """Take snapshots, in a block."""
    hook = register_optimizer_step_post_hook(kept.see)
    yield
    hook.remove()


def by_ours(steps: dict[str, np.ndarray], seen: spaces.Space, done: spaces.Space, epochs: int, seed: int) -> Snapshots:
    """Clone by `NeuralClone`, without steps that are held out."""
    from irl_gym.agents.neural_clone import NeuralClone

    learner = NeuralClone(net_arch=(32, 32), batch_size=32, learning_rate=1e-3, held_out=0.0, epochs=epochs)
    kept, rng, lengths = Snapshots(), np.random.default_rng(seed), steps["lengths"].tolist()
    with watched(kept):
        learner.fit(steps["observations"], steps["actions"], seen, done, lengths=lengths, rng=rng)
    return kept


def by_imitation(steps: dict[str, np.ndarray], seen: spaces.Space, done: spaces.Space, epochs: int, seed: int) -> Snapshots:
    """Clone by `imitation.algorithms.bc.BC`, as it is by default."""
    from imitation.algorithms.bc import BC  # pyright: ignore[reportMissingImports]
    from imitation.data.types import Transitions  # pyright: ignore[reportMissingImports]

    torch.manual_seed(seed)
    kept = Snapshots(lambda: ["value" not in name for name, _ in cloning.policy.named_parameters()])
    seen_then, acted, unread = steps["observations"], steps["actions"], np.zeros(len(steps["actions"]), dtype=bool)
    infos = np.array([{}] * len(acted))
    shown = Transitions(obs=seen_then, acts=acted, infos=infos, next_obs=seen_then, dones=unread)  # the last two are not read
    cloning = BC(
        observation_space=seen, action_space=done, rng=np.random.default_rng(seed), demonstrations=shown, batch_size=32,
        device="cpu",
    )  # fmt: skip
    with watched(kept):
        cloning.train(n_epochs=epochs, progress_bar=False)
    return kept


def space_of(low: np.ndarray, high: np.ndarray) -> spaces.Space:
    """Discrete of a number, or Box between arrays."""
    if low.ndim == 0:
        return spaces.Discrete(int(high))
    return spaces.Box(low.astype(np.float32), high.astype(np.float32))


def main() -> None:
    """Clone, and write the seconds (K,) and the weights (K, ...) of the snapshots."""
    whose, given, found, epochs, seed = sys.argv[1:]
    torch.set_num_threads(1)
    with np.load(given) as file:
        steps = {name: file[name] for name in file.files}
    seen, done = (space_of(steps[f"{name}_low"], steps[f"{name}_high"]) for name in ("observation", "action"))
    clone = {"ours": by_ours, "imitation": by_imitation}[whose]
    clone(steps, seen, done, 1, seed=0)  # what is done once a process, such as loading code
    kept = clone(steps, seen, done, int(epochs), int(seed))
    np.savez(found, seconds=np.array(kept.seconds), weights=np.array(kept.weights))


if __name__ == "__main__":
    main()
