"""Which wrappers only watch an environment, so that what is known of its inside still holds."""

import gymnasium as gym

WATCHING = frozenset({
    "TimeLimit", "OrderEnforcing", "PassiveEnvChecker", "RecordEpisodeStatistics", "RecordVideo", "HumanRendering",
    "RenderCollection", "Autoreset", "Monitor", "DataCollector",
})  # fmt: skip
"""Wrappers of Gymnasium, SB3 and Minari that only watch or limit; by name, since importing some needs packages of their own."""


def only_watches(wrapper: gym.Wrapper) -> bool:
    """Does this wrapper leave observations, actions and rewards as they are? It steps as its base does, or it is known."""
    kind = type(wrapper)
    same = kind.step is gym.Wrapper.step and kind.reset is gym.Wrapper.reset
    return same or kind.__name__ in WATCHING
