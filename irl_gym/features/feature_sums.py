"""Discounted sums of features along episodes: V^_i of Ng & Russell (2000), equation (11).

    V^_i(s_0) = mean over episodes of sum_t gamma^t phi_i(s_t), starting with phi_i(s_0)
The value of the policy that made the episodes, under R = alpha . phi, is then alpha . V^. The state in which an episode
ended counts once, and not where it was not recorded (`Episode.ending`). Axes: N episodes, K features.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from irl_gym.errors import InvalidDemonstrations
from irl_gym.features.feature_maps import as_features, check_length, checked_features
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.spaces.states import States


def discounted_sums(
    episodes: Iterable[Episode], features: Any, gamma: float, *, states: States | None = None, horizon: int | None = None
) -> np.ndarray:
    """(N, K) sum_t gamma^t phi(s_t) of each episode.

    Args:
        episodes: at least one.
        features: phi, a map of the observations, or of rows where `states` is given; or an array (S, K).
        gamma: discount.
        states: turns observations into rows.
        horizon: steps after which an episode is cut; None for no cut.

    Raises:
        InvalidDemonstrations: no episode.
        InvalidDiscount: gamma outside (0, 1).
        InvalidFeatures: features that do not fit the observations.
    """
    check_discount(gamma)
    phi = as_features(features)
    if states is not None:
        check_length(phi, states.n_states)
    sums = []
    for episode in episodes:
        visited = checked_features(phi, episode.observations if states is None else episode.rows(states))
        visited = visited[:-1] if episode.ending == "unseen" else visited
        kept = visited if horizon is None else visited[: horizon + 1]
        sums.append(gamma ** np.arange(len(kept)) @ kept)
    if not sums:
        raise InvalidDemonstrations("there are no episodes: expected at least one.")
    return np.array(sums)


def feature_expectations(episodes: Iterable[Episode], features: Any, states: States | None, gamma: float) -> np.ndarray:
    """(K,) mean over episodes of sum_t gamma^t phi(s_t), starting with phi(s_0): equation (11) of Ng & Russell.

    Args:
        episodes: at least one.
        features: (S, K) phi, or a feature map of the rows.
        states: turns observations into rows of phi; None where the features are of the observations.
        gamma: discount.

    Raises:
        InvalidDemonstrations: no episode.
        InvalidDiscount: gamma outside (0, 1).
        InvalidFeatures: features of the wrong shape.
    """
    return discounted_sums(episodes, features, gamma, states=states).mean(axis=0)
