"""Any discrete environment to an exact transition table.

`tabulate(env, gamma=...)` asks each source in `SOURCES` in turn; today there are two, an environment that is a table
(TabularEnv) and the table that an environment publishes. Wrappers are looked through, and a TimeLimit stays out: truncation is
not part of an MDP. Then `env.step` is sampled and compared with the table.
"""

import difflib
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium as gym
from gymnasium import spaces

from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter, InvalidReward, IrlGymError, NotDiscrete, NotTabular, UnknownEnvironment
from irl_gym.linear_reward import LinearReward
from irl_gym.mdp import check_discount
from irl_gym.published_table import published_table
from irl_gym.rewards import TabularReward
from irl_gym.selfcheck import compare_with_steps
from irl_gym.states import StateIndex
from irl_gym.tabular_env import TabularEnv
from irl_gym.tabulation import Evidence, Tabulation, payments_of
from irl_gym.watching import only_watches
from irl_gym.wrappers import LearnedReward

OWN_ENVIRONMENTS = (
    "irl_gym_envs:irl_gym/GridWorld-v0", "irl_gym_envs:irl_gym/FourRooms-v0", "irl_gym_envs:irl_gym/MountainCar-v0",
    "irl_gym_envs:irl_gym/ContinuousGridWorld-v0",
)  # fmt: skip
"""Offered by name to who mistypes them; importing their module is what registers them."""

Source = Callable[[gym.Env, float], Tabulation | None]


def tabulate(env: gym.Env, *, gamma: float, check_steps: int = 10_000, seed: int = 0) -> Tabulation:
    """Make the exact transition table of a discrete environment. The environment itself is neither stepped nor reset.

    Args:
        env: a Gymnasium environment. Wrappers that only watch or limit it are looked through; LearnedReward gives its reward;
            wrappers that change observations, actions or rewards are refused.
        gamma: discount in (0, 1); no environment carries one.
        check_steps: steps of a copy of the environment to compare with the table; 0 for none.
        seed: of the check.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        NotDiscrete: a continuous action or observation space.
        NotTabular: no table is published, or something acts outside it, such as a wrapper.
        TableMismatch: `env.step` did what the table says is impossible.
    """
    check_discount(gamma)
    if not isinstance(env, gym.Env):
        raise InvalidParameter(f"env is a {type(env).__name__}: expected an environment, such as gymnasium.make gives.")
    for name, value in (("check_steps", check_steps), ("seed", seed)):
        checked_number(name, value, "a whole number of at least 0", least=0, whole=True)
    learned = _learned_reward(env)
    if not isinstance(env.action_space, spaces.Discrete):
        raise NotDiscrete(
            f"the action space is {env.action_space}: expected Discrete. Discretise the actions first, as with "
            "`gymnasium.wrappers.DiscretizeAction`."
        )
    for source in SOURCES:
        found = source(env, gamma)
        if found is not None:
            break
    else:
        StateIndex(env.unwrapped.observation_space)  # when it is not discrete, that is the deeper reason
        raise NotTabular(
            f"{type(env.unwrapped).__name__} publishes no transition table: expected `env.unwrapped.P[s][a]`, a list of "
            "(probability, successor, reward, terminated). Give the environment such a `P`, or build a TabularMDP yourself "
            "and use TabularEnv."
        )
    if check_steps:
        check = compare_with_steps(env, found.mdp, found.states, found.payments, steps=int(check_steps), seed=int(seed))
        found = replace(found, evidence=replace(found.evidence, check=check))
    return found if learned is None else _with_reward(found, learned)


def make(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with the closest names when the id is unknown.

    Raises:
        UnknownEnvironment: no such id.
        InvalidParameter: arguments that the environment does not take.
    """
    try:
        return gym.make(env_id, **kwargs)
    except (TypeError, KeyError, ValueError) as error:
        if isinstance(error, IrlGymError):
            raise
        unexpected = re.search(r"unexpected keyword argument '(\w+)'", str(error))
        if unexpected:
            raise InvalidParameter(
                f"{env_id} takes no argument {unexpected[1]!r}: expected those of the environment's constructor."
            ) from error
        raise InvalidParameter(f"{env_id} cannot be made with {kwargs}: {type(error).__name__}: {error}.") from error
    except (gym.error.Error, ModuleNotFoundError) as error:
        module, _, name = env_id.rpartition(":")
        if module and isinstance(error, ModuleNotFoundError) and f"'{module}'" in str(error):
            raise UnknownEnvironment(
                f"environment {env_id!r} is of module {module!r}, which cannot be imported: expected an installed one. Install "
                "the package that has it."
            ) from error
        if not isinstance(error, gym.error.UnregisteredEnv | gym.error.DeprecatedEnv) and "Malformed" not in str(error):
            raise InvalidParameter(f"{env_id} cannot be made here: {error}") from error  # the message says what is missing
        known = {id.rpartition(":")[2]: id for id in (*gym.registry, *OWN_ENVIRONMENTS)}
        close = [known[match] for match in difflib.get_close_matches(name, known, n=3, cutoff=0.5)]
        offer = f" The closest are {', '.join(close)}." if close else ""
        raise UnknownEnvironment(
            f"environment {env_id!r} is not registered: expected an id such as 'FrozenLake-v1'.{offer} An environment of "
            "another package needs its module named first, as in 'irl_gym_envs:irl_gym/GridWorld-v0'."
        ) from error


def _learned_reward(env: gym.Env) -> LearnedReward | None:
    """The outermost LearnedReward around an environment; refuses wrappers that a table knows nothing of."""
    learned, wrapper = None, env
    while isinstance(wrapper, gym.Wrapper):
        if isinstance(wrapper, LearnedReward):
            learned = learned or wrapper
        elif not only_watches(wrapper):
            raise NotTabular(
                f"the wrapper {type(wrapper).__name__} changes the environment outside its table: expected wrappers that only "
                "watch or limit it. Tabulate `env.unwrapped`, or give the environment that change itself."
            )
        wrapper = wrapper.env
    return learned


def _with_reward(found: Tabulation, learned: LearnedReward) -> Tabulation:
    """The table with the reward that LearnedReward pays."""
    mdp, paid = found.mdp, learned.reward_function
    if isinstance(paid, LinearReward):
        paid = paid.tabular(found.states if learned.states is None else learned.states.n_states)
    if learned.states is not None and learned.states.n_states != mdp.n_states:
        raise InvalidReward(
            f"the learned reward has {learned.states.n_states} states: expected {mdp.n_states}, the table's. Give "
            "LearnedReward the `states` of this table."
        )
    payments = payments_of(mdp, paid)
    return replace(found, reward=TabularReward(payments.mean, {"source": "LearnedReward"}), payments=payments)


def _own(env: gym.Env, gamma: float) -> Tabulation | None:
    """The table of a TabularEnv, which is one."""
    base = env.unwrapped
    if not isinstance(base, TabularEnv):
        return None
    mdp = base.mdp(gamma)
    payments = payments_of(mdp, base.reward)
    evidence = Evidence("The environment is its table (TabularEnv).", exact=True, merged=0, split=0, check=None)
    index = StateIndex(base.observation_space)
    return Tabulation(mdp, TabularReward(payments.mean, {"source": "environment"}), payments, index, evidence)


SOURCES: tuple[Source, ...] = (_own, published_table)
"""Asked in turn for a table; the first answer is taken."""
