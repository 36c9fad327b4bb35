"""Runs made of their parts, in a second and without a folder, for the tests of the page."""

import io

import gymnasium as gym
import numpy as np
from patients import sampled
from PIL import Image, ImageDraw

from irl_gym.features.bases import RadialBasis
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.curves import Curve
from irl_gym.judging.metrics import agreement, optimal_actions, policy_value, random_value, worst_tie
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.sections.verdict import verdict
from irl_gym.runs.certificates import certificate_of
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.films import Film, Moment
from irl_gym.runs.run import Run
from irl_gym.runs.scorecard import reward_told
from irl_gym.runs.supply import supplied
from irl_gym.spaces.names import action_names, state_name
from irl_gym.tables.layouts import grid_layout
from irl_gym.tables.tabulate import tabulate

SCRIPT = ["irl-gym", "run"]
NO_CURVE = Curve(*np.zeros((5, 0)))


def scene_of(run):
    """What is known of a run state by state."""
    found = RunContents(run).scene
    assert found is not None
    return found


def section_of(show, run, **changed):
    """A section of a run's page."""
    return supplied(show, RunContents(run), run, **changed)


def table_run(path, env_id="FrozenLake-v1", *, seed=0, errors=2, l1=0.0, frames=False, reward_on="state", films=True, **kwargs):
    """A run on a table; the agent makes `errors` mistakes."""
    env = gym.make(env_id, **kwargs)
    table = tabulate(env, gamma=0.9, check_steps=0)
    mdp, true = table.mdp, table.reward
    expert = policy_iteration(mdp, true).policy
    learner = FiniteLP(l1=l1, report_lambda_0=True, reward_on=reward_on)
    result = learner.fit(mdp, expert)
    agent, rng = expert.copy(), np.random.default_rng(seed)
    acting = np.flatnonzero(mdp.reachable & ~mdp.terminal)
    agent[rng.choice(acting, size=errors, replace=False)] = rng.integers(mdp.n_actions, size=errors)
    layout = grid_layout(env, mdp)
    config = Experiment(env_id, 0.9, env_kwargs=kwargs, learner=learner, seed=seed).to_json()
    names = action_names(env)
    certificate = certificate_of(result, (table, expert), episodes=False)
    metrics = {
        "policies": policies_of(mdp, true, expert, agent),
        "reward": reward_of(table, result, expert, certificate),
        "training": {"environment_steps": 4000, "steps_to_0.9": 1200, "steps_to_0.99": 1600},
        "table": table_told(table),
        "demonstrations": {"given": False, "episodes_only": False, "episodes": 10, "dataset": "made-v0"},
    }
    level = metrics["policies"]["expert"]["value"]
    steps = np.arange(0, 4001, 400)
    grown = level * (1 - np.exp(-steps / 900))
    return Run(
        path=path, config=config,
        version={"format": "irl_gym.Run/1", "irl_gym": "0.0", "command": [*SCRIPT, "--env-id", env_id, "--seed", str(seed)]},
        env_id=env_id, actions=names, table=table, learned=result.reward, expert=expert, agents={"retrained": agent},
        certificate=certificate, metrics=metrics,
        curve=Curve(steps.astype(float), grown, grown * 1.1, grown - 0.1 * abs(level), grown * 1.1 + 0.1 * abs(level)),
        stages={"reward": {"seconds": 0.4}, "agent": {"seconds": 131.0, "environment_steps": 4000}, "report": {"seconds": 1.0}},
        grid=layout,
        films=films_of(env, env_id, table, result.reward, {"expert": expert, "agent": agent}, seed, frames) if films else {},
        diagnosis=diagnosis_of(acting), widths=widths_of(table, result.reward),
        lambda_path=path_of(mdp, expert, reward_on) if reward_on == "state" else None, recomputed=True, vouched=True,
    )  # fmt: skip


def policies_of(mdp, true, expert, agent):
    best = optimal_actions(mdp, true)
    uniform = np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)
    top, bottom = policy_value(mdp, true, expert), random_value(mdp, true)
    how = {"expert": "planned by value iteration", "random": "uniformly random actions", "retrained": "trained by PPO"}
    told = {}
    for name, policy in {"expert": expert, "random": uniform, "retrained": agent}.items():
        value = policy_value(mdp, true, policy)
        spread = {"mean_return": value * 1.1, "return_low": value * 1.1 - 0.05, "return_high": value * 1.1 + 0.05}
        score = (value - bottom) / (top - bottom)
        told[name] = {"how": how[name], "value": value, "score": score, **spread, "agreement": agreement(mdp, policy, best)}
    return told


def reward_of(table, result, expert, certificate):
    mdp, true = table.mdp, table.reward
    top, bottom, worst = policy_value(mdp, true, expert), random_value(mdp, true), worst_tie(mdp, result.reward, true).value
    regret = {"worst_tie_regret": top - worst, "worst_tie_regret_share": (top - worst) / (top - bottom)}
    told = {"learner": "FiniteLP", "status": result.status.value, **reward_told(certificate)}
    return {**told, **regret, "worst_tie_value": worst}


def table_told(table):
    mdp = table.mdp
    return {
        "horizon": None, "states": mdp.n_states, "reachable": int(mdp.reachable.sum()), "actions": mdp.n_actions,
        "transitions": mdp.P.nnz, "split": 0, "exact": True, "error": 0.0, "method": table.evidence.method, "check": None,
    }  # fmt: skip


def path_of(mdp, expert, reward_on):
    """Rewards at a few lambdas: not the whole path, but shaped like it."""
    top = FiniteLP(report_lambda_0=True).fit(mdp, expert).proof.lambda_0
    ends = np.linspace(0, top, 7)
    found = [FiniteLP(l1=float(l1), reward_on=reward_on).fit(mdp, expert) for l1 in (0.0, *(ends[1:-1] + 0.01 * top))]
    margins = np.stack([certify(mdp, expert, one.reward).margin for one in found])
    rewards = np.stack([one.reward.values for one in found])
    norms = np.abs(rewards).sum(axis=1)
    return {
        "breakpoints": ends, "rewards": rewards, "margins": margins, "l1_norms": norms,
        "total_margins": np.nansum(margins, axis=1), "gap": np.array(0.0), "exact": np.array(True),
        "r_max": np.array(1.0), "margin_cap": np.array(np.nan),
    }  # fmt: skip


def widths_of(table, learned):
    width = np.where(table.mdp.reachable, np.linspace(0, 1, table.mdp.n_states), np.nan)
    middle = learned.expected(table.mdp).max(axis=1)
    return {"low": middle - width / 2, "high": middle + width / 2, "width": width}


def diagnosis_of(acting):
    return {
        "answer": "findings",
        "why": None,
        "examined": "Examined: the table.",
        "findings": [
            {"name": "ties", "sentence": "Two actions are <b>tied</b>.", "mend": "Try --margin-cap auto.",
             "states": acting[:3].tolist(), "actions": [0, 1, 0], "flags": []},
        ],
    }  # fmt: skip


def verdict_of(run):
    """What stands at the top of a run's page."""
    return supplied(verdict, RunContents(run), run)


def films_of(env, env_id, table, learned, policies, seed, frames):
    return {name: film_of(env, env_id, table, learned, policy, name, seed, frames) for name, policy in policies.items()}


def film_of(env, env_id, table, learned, policy, name, seed, frames):
    layout = grid_layout(env, table.mdp)
    columns = None if layout is None else layout.shape[1]
    observation, _ = env.reset(seed=seed)
    at = table.states.encode(observation)
    moments = [Moment(state_name(env_id, observation, columns), at, None, None, None, None, 0.0, 0.0, 0 if frames else None)]
    total = paid = 0.0
    terminated = truncated = False
    while not (terminated or truncated) and len(moments) < 60:
        action = int(policy[at])
        observation, true, terminated, truncated, _ = env.step(action)
        before, at = at, table.states.encode(observation, terminated=terminated)
        total, paid = total + float(true), paid + float(learned.pay(before, action, at))
        told = state_name(env_id, observation, columns)
        named = action_names(env)[action]
        step = float(learned.pay(before, action, at))
        moments.append(Moment(told, at, action, named, float(true), step, total, paid, len(moments) if frames else None))
    pictures = tuple(picture(i) for i in range(len(moments))) if frames else ()
    ends = "terminated" if terminated else "truncated" if truncated else "cut"
    return Film(name, seed, tuple(moments), ends, pictures, "webp", None if frames else "it draws none here.")


def picture(i):
    image = Image.new("RGB", (160, 120), (230, 235, 240))
    ImageDraw.Draw(image).ellipse((i * 4 % 130, 40, i * 4 % 130 + 30, 70), fill=(200, 80, 20))
    kept = io.BytesIO()
    image.save(kept, "webp", lossless=True)
    return kept.getvalue()


def stepped_run(path, *, seed=0):
    """A run without a table: CartPole, a reward of radial features."""
    rng = np.random.default_rng(seed)
    features = RadialBasis(rng.normal(size=(60, 4)), 1.0)
    learned = LinearReward(rng.uniform(-1, 1, 60).round(3), features)
    row = {"value": 90.0, "score": 1.0, "mean_return": 480.0, "return_low": 460.0, "return_high": 500.0, "agreement": None}
    policies = {
        "expert": row,
        "random": {**row, "value": 20.0, "score": 0.0, "mean_return": 22.0, "return_low": 20.0, "return_high": 24.0},
        "retrained": {**row, "value": 85.0, "score": 0.93, "mean_return": 450.0, "return_low": 420.0, "return_high": 480.0},
    }
    certificate = certificate_of(sampled(gaps=np.array([1.0]), gap_errors=np.array([0.1]), n_features=60), None, episodes=True)
    metrics = {
        "policies": policies, "table": None, "training": {"environment_steps": 60_000, "steps_to_0.99": None},
        "reward": {"learner": "TrajectoryLP", "status": "optimal", "rounds": 5, "best_round": 3,
                   **reward_told(certificate)},
        "demonstrations": {"given": False, "episodes_only": True, "episodes": 10, "dataset": "made-v0"},
    }  # fmt: skip
    moments = [
        Moment(f"({0.1 * i:.2f}, 0.2, -0.1, 0)", None, i % 2 if i else None, ("push left", "push right")[i % 2] if i else None,
               1.0 if i else None, 0.1 if i else None, float(i), 0.1 * i) for i in range(12)
    ]  # fmt: skip
    return Run(
        path=path, config=Experiment("CartPole-v1", 0.99, seed=seed).to_json(),
        version={"format": "irl_gym.Run/1", "irl_gym": "0.0", "command": None}, env_id="CartPole-v1",
        actions=("push left", "push right"), table=None, learned=learned, expert=None, agents={},
        certificate=certificate, metrics=metrics,
        curve=Curve(*np.array([[0.0, 30_000, 60_000], [20, 60, 85], [22, 200, 450], [20, 150, 420], [24, 240, 480]])),
        stages={"agent": {"seconds": 50.0, "environment_steps": 60_000}}, grid=None,
        films={"agent": Film("agent", 3, tuple(moments), "cut", (), "webp", "pygame is not installed.")},
        diagnosis={"answer": "healthy", "why": None, "examined": "Examined: it.", "findings": []},
        widths=None, lambda_path=None, vouched=True,
    )  # fmt: skip
