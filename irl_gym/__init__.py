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
    LearnedReward(env, reward)                the environment, paying the learned reward
    TabularEnv, TabularVecEnv                 a table as an environment, or as thousands of copies for Stable-Baselines3
    SB3("PPO").plan(env, gamma=...)           an agent trained on it; ValueIteration().plan(...) plans exactly
    collect, write_minari, read_minari        demonstrations
    recover_and_retrain(Experiment(...), out) all of it in one call

Each name's own module says more: `help(irl_gym.learners.linear_programs.finite)` for the linear programs. Errors derive from
IrlGymError. The names below are imported when first used; `import irl_gym` itself loads no torch, cvxpy, minari or matplotlib.
"""

import lazy_loader

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
