"""Any discrete environment to an exact transition table.

`tabulate(env, gamma=...)` asks each source in `SOURCES` in turn: an environment that is a table (TabularEnv), the table that an
environment publishes, rules that are known (Blackjack), a model that the environment offers (gym-classics). Where none answers,
copies of the environment are enumerated, and where `by` says so its steps are sampled. A TimeLimit stays out, unless a wrapper
around it reads it: truncation is not part of an MDP. Then `env.step` is sampled and compared with the table: an exact one step
by step, one that is an estimate by fresh episodes, as a second sample.
"""

import difflib
import inspect
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator

from irl_gym.checks import checked_number, discrete_actions, no_module
from irl_gym.environments.closing import close
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.reveal import layers
from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.environments.watching_wrappers import only_watches
from irl_gym.errors import (
    InvalidParameter,
    InvalidReward,
    IrlGymError,
    NotDiscrete,
    NotTabular,
    UnknownEnvironment,
    a_type,
    did_you_mean,
)
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.blackjack import blackjack_table
from irl_gym.tables.copies.calls import seeded_globals
from irl_gym.tables.copies.time_limits import limited
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.fresh_episodes import compare_with_episodes
from irl_gym.tables.observed_integers import as_integers
from irl_gym.tables.published_model import model_table
from irl_gym.tables.published_table import published_table
from irl_gym.tables.selfcheck import SelfCheck, compare_with_steps
from irl_gym.tables.tabulation import Evidence, Tabulation, payments_of

OWN_ENVIRONMENTS = (
    "irl_gym_envs:irl_gym/GridWorld-v0", "irl_gym_envs:irl_gym/FourRooms-v0", "irl_gym_envs:irl_gym/MountainCar-v0",
    "irl_gym_envs:irl_gym/ContinuousGridWorld-v0",
)  # fmt: skip
"""Offered by name to who mistypes them; importing their module is what registers them."""

NO_WORLDS = ("GymV21Environment-v0", "GymV26Environment-v0")
"""What Gymnasium registers that stands for nothing by itself: nobody means it."""
Source = Callable[[gym.Env, float], Tabulation | None]


@runtime_checkable
class By(Protocol):
    """A way to make a table that a caller asks for: `Enumeration(...)` or `Interaction(...)`."""

    def table(self, env: gym.Env, gamma: float, progress: Callable[[int, int], None] | None = None, /) -> Tabulation:
        """The table of an environment; `progress` is told how many of how many."""
        ...


def tabulate(
    env: gym.Env,
    *,
    gamma: float,
    by: By | None = None,
    check_steps: int = 10_000,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Tabulation:
    """Make the transition table of a discrete environment. The environment itself is neither stepped nor reset.

    Args:
        env: a Gymnasium environment. A TimeLimit and wrappers that only watch are looked through; LearnedReward gives its
            reward; other wrappers belong to the environment. Where one of these reads a TimeLimit inside it, as
            TimeAwareObservation does, episodes end at the limit in the table too, whose states have the time in them.
        gamma: discount in (0, 1); no environment carries one. It may be 1 where a wrapper reads a TimeLimit inside it.
        by: how. None is `Enumeration(known=True)`: what is known of the environment, and enumeration where nothing is.
            `irl_gym.tables.enumeration.table.Enumeration(...)` has limits and can be continued;
            `irl_gym.tables.counted.counting.Interaction(...)` counts what random steps do.
        check_steps: steps of a copy of the environment to compare with the table; 0 for none.
        seed: of the check.
        progress: called with two numbers as an enumeration goes on: states tried and found.

    Raises:
        InvalidDiscount: gamma outside (0, 1), or 1 of an environment without such a wrapper.
        NotDiscrete: a continuous action or observation space.
        NotTabular: the environment cannot be copied, or something acts outside its table.
        HiddenState: one observation behaves in two ways.
        EnumerationLimit: more states than allowed.
        UnknownObservation, InvalidReward: the environment left its own observation space, or paid NaN.
        TableMismatch: `env.step` did what the table says is impossible, or does other things than it did when it was counted.
    """
    if not isinstance(env, gym.Env):
        raise InvalidParameter(f"env is {a_type(env)}: expected an environment, such as gymnasium.make gives.")
    limit, wrappers = limited(env)
    check_discount(gamma, limit if wrappers else None)
    for name, value in (("check_steps", check_steps), ("seed", seed)):
        checked_number(name, value, "a whole number of at least 0", least=0, whole=True)
    discrete_actions(env.action_space)
    learned = _learned_reward(env)
    if by is not None and (isinstance(by, type) or not isinstance(by, By)):
        raise InvalidParameter(
            f"by is {by!r}: expected None, `Enumeration(...)` or `Interaction(...)`, made with its arguments."
        )
    by = by or Enumeration(known=True)
    known = (source(env, gamma) for source in SOURCES) if isinstance(by, Enumeration) and by.known else ()
    found = next(filter(None, known), None)
    if found is None:
        try:
            found = by.table(env, gamma, progress)
        except NotDiscrete as error:
            raise as_integers(env, error) from None
    if check_steps:
        found = replace(found, evidence=replace(found.evidence, check=_checked(env, found, int(check_steps), int(seed))))
    return found if learned is None else _with_reward(found, learned)


def _checked(env: gym.Env, found: Tabulation, steps: int, seed: int) -> SelfCheck | None:
    """What sampling the environment says of a table; None where there is nothing to compare with."""
    with seeded_globals([seed]):
        if found.evidence.exact:
            return compare_with_steps(env, found.mdp, found.states, found.payments, steps=steps, seed=seed)
        return None if found.samples is None else compare_with_episodes(env, found, found.samples, steps=steps, seed=seed)


def make(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with the closest names when the id is unknown.

    Raises:
        UnknownEnvironment: no such id.
        InvalidParameter: arguments that the environment does not take.
    """
    try:
        env = gym.make(env_id, **kwargs)
        _check_flags(env, kwargs)
        return env
    except (TypeError, KeyError, ValueError) as error:
        if isinstance(error, IrlGymError):
            raise
        _check_named(env_id, error, kwargs)
        unexpected = re.search(r"unexpected keyword argument '(\w+)'", str(error))
        if unexpected:
            names = _arguments_of(env_id)
            known = f" ({', '.join(names)})" if names else ""
            raise InvalidParameter(
                f"{env_id} takes no argument {unexpected[1]!r}: expected those of the environment's constructor"
                f"{known}.{did_you_mean(unexpected[1], names)}"
            ) from error
        raise InvalidParameter(f"{env_id} cannot be made with {kwargs}: {type(error).__name__}: {error}.") from error
    except (gym.error.Error, ModuleNotFoundError) as error:
        module, _, name = env_id.rpartition(":")
        missing = getattr(error.__cause__, "name", None)
        if module and missing and f"{module}.".startswith(f"{missing}."):  # else it is of something that the module imports
            raise UnknownEnvironment(f"environment is {env_id!r}, and {no_module(missing, name)}") from error
        if not isinstance(error, gym.error.UnregisteredEnv | gym.error.DeprecatedEnv) and "Malformed" not in str(error):
            raise InvalidParameter(f"{env_id} cannot be made here: {error}") from error  # the message says what is missing
        known = {one: f"{module}:{one}" if _made_by(module, one) else one for one in gym.registry if one not in NO_WORLDS}
        known |= {one.rpartition(":")[2]: one for one in OWN_ENVIRONMENTS}
        close = [known[match] for match in difflib.get_close_matches(name, known, n=3, cutoff=0.5)]
        offer = f" The closest are {', '.join(close)}." if close else ""
        if name.startswith(("MiniGrid-", "BabyAI-")):
            offer = " MiniGrid's tasks are irl_gym_envs:irl_gym/MiniGrid-v0 with env_kwargs such as task=DoorKey-6x6."
        raise UnknownEnvironment(
            f"environment {env_id!r} is not registered: expected an id such as 'FrozenLake-v1'.{offer} An environment of "
            "another package, or of a file of your own, needs its module named first, as in 'my_env:MyEnv-v0' for my_env.py."
        ) from error


def _made_by(module: str, env_id: str) -> bool:
    """Does a module make an environment, so that it is named by it?"""
    entry = gym.registry[env_id].entry_point
    where = entry.partition(":")[0] if isinstance(entry, str) else getattr(entry, "__module__", "")
    return bool(module) and where.split(".")[0] == module.split(".")[0]


def _check_named(env_id: str, error: Exception, kwargs: dict[str, Any]) -> None:
    """Name the values that an argument can have, where it was looked for in a dict of the environment's module.

    Raises:
        InvalidParameter: it was, and is not there.
    """
    last = error.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    named = [name for name, value in kwargs.items() if isinstance(error, KeyError) and error.args == (value,)]
    if last is None or not named:
        return
    frame = last.tb_frame
    known = [frame.f_globals.get(name) for name in frame.f_code.co_names]
    choices, *more = [one for one in known if isinstance(one, dict) and one and kwargs[named[0]] not in one] or [None]
    if choices is not None and not more:
        raise InvalidParameter(
            f"{named[0]} is {kwargs[named[0]]!r}, which {env_id} does not know: expected one of "
            f"{', '.join(map(str, [*choices][:20]))}."
        ) from error


def _arguments_of(env_id: str) -> list[str]:
    """The names of an environment's arguments; none where they cannot be told."""
    entry = gym.spec(env_id.rpartition(":")[2]).entry_point
    maker = load_env_creator(entry) if isinstance(entry, str) else entry
    if maker is None:
        return []
    return [name for name in inspect.signature(maker).parameters if name != "render_mode"]


def _check_flags(env: gym.Env, kwargs: dict[str, Any]) -> None:
    """Refuse text where the constructor's default is true or false: "flase" would be true."""
    known = inspect.signature(type(env.unwrapped).__init__).parameters
    for name, value in kwargs.items():
        if isinstance(value, str) and name in known and isinstance(known[name].default, bool):
            close(env)
            raise InvalidParameter(f"{name} is {value!r}: expected true or false, as its default {known[name].default}.")


def _learned_reward(env: gym.Env) -> LearnedReward | None:
    """The outermost LearnedReward around an environment.

    Raises:
        NotTabular: a wrapper around it that changes what it pays.
    """
    outside = []
    for wrapper in layers(env):
        if isinstance(wrapper, LearnedReward):
            if outside:
                raise NotTabular(
                    f"the wrapper {outside[0]} around LearnedReward changes the environment: expected LearnedReward outside, "
                    "but for wrappers that only watch or limit. Put it inside."
                )
            return wrapper
        if isinstance(wrapper, gym.Wrapper) and not only_watches(wrapper):
            outside.append(type(wrapper).__name__)
    return None


def _plain(env: gym.Env) -> bool:
    """Is the environment what its base is, but for wrappers that watch, and LearnedReward?"""
    wrappers = (layer for layer in layers(env) if isinstance(layer, gym.Wrapper))
    return all(isinstance(wrapper, LearnedReward) or only_watches(wrapper) for wrapper in wrappers)


def _published(env: gym.Env, gamma: float) -> Tabulation | None:
    return published_table(env, gamma) if _plain(env) else None


def _model(env: gym.Env, gamma: float) -> Tabulation | None:
    return model_table(env, gamma) if _plain(env) else None


def _with_reward(found: Tabulation, learned: LearnedReward) -> Tabulation:
    """The table with the reward that LearnedReward pays."""
    mdp = found.mdp
    paid: Any = learned.reward_function
    if hasattr(paid, "tabular"):
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
    if not isinstance(base, TabularEnv) or not _plain(env):
        return None
    mdp = base.mdp(gamma)
    payments = payments_of(mdp, base.reward)
    evidence = Evidence("The environment is its table (TabularEnv).", exact=True, merged=0, split=0, check=None)
    index = StateIndex(base.observation_space)
    return Tabulation(mdp, TabularReward(payments.mean, {"source": "environment"}), payments, index, evidence)


SOURCES: tuple[Source, ...] = (_own, _published, blackjack_table, _model)
"""Asked in turn for a table; the first answer is taken."""
