"""irl_gym: inverse reinforcement learning for Gymnasium.

    tabulate(env, gamma=...)                  an environment as an exact table: mdp, reward, states, evidence
    TabularMDP(P, gamma, d0)                  the same from arrays
    value_iteration, policy_iteration         optimal policies of a table
    discretize(env, gamma=..., bins=...)      a continuous environment as a table of cells
    FiniteLP().fit(mdp, expert)               a reward under which the expert is optimal, with a proof of its program
    certify(mdp, expert, reward)              what any reward says of an expert: is it optimal, by what margins, and where not
    FeatureLP(phi).fit(mdp, expert)           the same as a LinearReward, alpha . phi, for large state spaces
    TrajectoryLP(phi).fit(Simulator(env, planner, gamma), episodes)     from the expert's episodes alone
    worst_tie(mdp, learned, true)             what the worst policy that is greedy under the learned reward earns
    doctor(result, mdp, expert)               why a reward came out zero, flat or useless, in sentences, each with a mend
    LearnedReward(env, result, shaping=table) the environment, paying the learned reward so that agents learn it
    plot(result, env)                         a picture of a reward, a policy or values, on the environment's map
    TabularEnv, TabularVecEnv                 a table as an environment, or as thousands of copies for Stable-Baselines3
    SB3("PPO").plan(env, gamma=...)           an agent trained on it; ValueIteration().plan(...) plans exactly
    collect, write_minari, read_minari        demonstrations
    recover_and_retrain(Experiment(...), out) all of it in one call

Each name's own module says more: `help(irl_gym.learners.linear_programs.finite)` for the linear programs. Errors derive from
IrlGymError. The names below are imported when first used; `import irl_gym` itself loads no torch, cvxpy, minari or matplotlib.
"""

import lazy_loader

__version__ = "0.1.0"
_found, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str):
    if name in __all__ or name.startswith("_"):
        return _found(name)
    import sys
    from difflib import get_close_matches
    from importlib.util import find_spec

    near = get_close_matches(name.lower(), by_lower := {one.lower(): one for one in __all__}, n=1)
    mend = f" Use irl_gym.{by_lower[near[0]]}." if near else " `help(irl_gym)` lists them."
    told = f"irl_gym has no {name}: expected one of its names.{mend}"
    # `from irl_gym import name` asks first whether the name is there, and says nothing but its own words to an AttributeError
    imported = sys._getframe(1).f_code.co_name == "_handle_fromlist"
    if near and imported and find_spec(f"irl_gym.{name}") is None:
        raise ImportError(told, name=__name__)
    raise AttributeError(told)
