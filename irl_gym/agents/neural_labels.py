"""Labels of observations, such as an oracle gives, cloned by a network: `NeuralClone` as a class of policies of DAgger.

torch is imported when a network is made: to read what the learner needs costs none.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from irl_gym.agents.neural_proof import Epoch, NeuralProof
from irl_gym.checks import discrete_actions
from irl_gym.learners.base import Outcome
from irl_gym.learners.problem import Spaces
from irl_gym.spaces.batches import by_part
from irl_gym.spaces.states import States

if TYPE_CHECKING:
    from stable_baselines3 import PPO

    from irl_gym.agents.planners import Agent


class FitsLabels:
    """A learner by `fit` and `_model`, of labels in the spaces of a problem."""

    fit: Any
    _model: Any

    def fit_labels(
        self, seen: Sequence[Any], labels: Sequence[np.ndarray], known: Spaces, rng: np.random.Generator,
        on_epoch: Epoch | None = None, model: "PPO | None" = None,
    ) -> Outcome[None, NeuralProof]:  # fmt: skip
        """The same of episodes that are labelled step by step, whatever was done in them.

        Args:
            seen: of each episode its labelled observations, stacked.
            labels: of each episode what is to be done there.
            known: the spaces.
            rng: as `fit`, and so the errors.
            on_epoch: as `fit`.
            model: the same.

        Raises:
            NotDiscrete: actions that are not one number.
        """
        from irl_gym.agents.planners import Agent

        states, space = self._shown(known)
        parts = seen if states is None else [states.encode_batch(one) for one in seen]
        stacked = by_part(lambda *arrays: np.concatenate(arrays), *parts)
        actions = spaces.Discrete(int(discrete_actions(known.actions).n))
        found = self.fit(
            stacked,
            np.concatenate(labels),
            space,
            actions,
            lengths=[*map(len, labels)],
            rng=rng,
            on_epoch=on_epoch,
            model=model,
        )
        return Outcome(None, found.status, found.proof, found.stats, Agent(found.policy.model, states))

    def arrays(self, agent: "Agent") -> dict[str, np.ndarray]:
        """What an agent of `fit_labels` has learned, as arrays by name."""
        return {name: one.numpy(force=True) for name, one in agent.model.policy.state_dict().items()}

    def agent(self, arrays: Mapping[str, np.ndarray], known: Spaces) -> "Agent":
        """The agent of such arrays.

        Raises:
            DamagedFile: they are those of another network, or not finite.
        """
        import torch

        from irl_gym.agents.checkpoint_checks import same_shapes
        from irl_gym.agents.planners import Agent

        states, space = self._shown(known)
        actions = spaces.Discrete(int(discrete_actions(known.actions).n))
        model = self._model(space, actions, np.random.default_rng(0))
        same_shapes("weights", arrays, model.policy.state_dict())
        model.policy.load_state_dict({name: torch.as_tensor(one) for name, one in arrays.items()})
        return Agent(model, states)

    def _shown(self, known: Spaces) -> tuple[States | None, spaces.Space]:
        """What the network is shown, and who turns observations into it: rows of the table, where SB3 takes no others."""
        from irl_gym.environments.tabular_vec_env import shows_rows

        states = known.states
        if states is None or not shows_rows(states):
            return None, known.observations
        return states, spaces.Discrete(states.n_states)
