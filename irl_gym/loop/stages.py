"""The stages of a run up to the judgement: each writes into a folder what it makes of what it needs, and returns its record.

A stage is one or several functions, of which those are called whose needs are there (`needs`): an expert is planned where one
may be, and read from the dataset where there is one. Parts are those of `irl_gym.loop.loop.Loop.sources`.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np

from irl_gym.agents.checkpoints import Checkpoint
from irl_gym.agents.expert_files import FromFile
from irl_gym.agents.neural_clone import NeuralClone
from irl_gym.agents.planners import SB3, Agent, Planner
from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.demonstrations.datasets import load_minari, write_minari
from irl_gym.demonstrations.endings import left_out
from irl_gym.demonstrations.minari_files import dataset_name, unkept
from irl_gym.demonstrations.shown import ShownPolicy
from irl_gym.errors import DamagedFile, InvalidParameter, InvalidReward, IrlGymError
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.metrics_schema import Certificate
from irl_gym.files.run_folder import LOGS, write_json
from irl_gym.files.run_schema import Stats, checked
from irl_gym.judging.curves import Curve, write_curve
from irl_gym.judging.evaluation import evaluate
from irl_gym.judging.scores import CLONE, EXPERT, LEARNED, RANDOM, RETRAINED
from irl_gym.learners.base import Learner, Outcome
from irl_gym.learners.interactive.labelled import write_labelled
from irl_gym.learners.problem import Problem, Spaces
from irl_gym.loop.learning_curve import Glances
from irl_gym.loop.worlds import RunWorld
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.policies import Policy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.runs.certificates import certificate_of, facts_in
from irl_gym.runs.experiment import class_name
from irl_gym.runs.logs import log_scalars, logged
from irl_gym.runs.scorecard import came_about, how_of, outcome_of, scorecard
from irl_gym.tables.tabulation import Tabulation

REWARD, SHAPED = "reward.npz", "reward_shaped.npz"
"""Where the recovered reward is kept; and, of a table, what an agent of anybody's own is paid (`LearnedReward(env, file)`)."""
OnProgress = Callable[[str, float | None, str], None]
"""Called with a stage, the share of it that is done, from 0 to 1, None where that cannot be known, and what else is known."""


def under_way(path: Path, stage: str) -> Path:
    """Where the training of a stage is kept until the stage is finished, in the folder of a run."""
    return path / f".{stage}.tmp.npz"


def clear(path: Path, stage: str) -> None:
    """Remove what was kept of a stage that is finished."""
    under_way(path, stage).unlink(missing_ok=True)
    shutil.rmtree(_rounds(path, stage), ignore_errors=True)


def _rounds(path: Path, stage: str) -> Path:
    """Where a learner that resumes keeps what it has until its stage is finished."""
    return path / f".{stage}.tmp"


def learned(learner: Learner, problem: Problem, seed: int, path: Path) -> Any:
    """What a learner gives, worked out now; in the folder of a run that was killed one that resumes goes on where it was."""
    more: dict[str, Any] = {"folder": _rounds(path, "reward")} if getattr(learner, "resumes", False) else {}
    return learner.learn(problem, np.random.default_rng(seed), **more)


def planned_expert(
    folder: Path, path: Path, teacher: Planner, world: RunWorld, epsilon: float, config: Mapping[str, Any],
    report_progress: OnProgress,
) -> dict[str, Any]:  # fmt: skip
    """An expert that plans, or learns, under the true reward."""
    kept = Checkpoint(under_way(path, "expert"), config)
    tell = _telling(report_progress, "expert", teacher, kept)
    policy = world.train(
        logged(teacher, folder / LOGS / "expert", kept), None, lambda steps, policy: tell(steps, _earned(policy))
    )
    world.keep(policy, folder, "expert", epsilon)
    made = {"environment_steps": 0, **teacher.trained()} if isinstance(teacher, FromFile) else _steps(policy, kept)
    return {"planner": type(teacher).__name__, "how": how_of(teacher), **made}


def recorded_expert(folder: Path, dataset: str, seen: ShownPolicy | None) -> dict[str, Any]:
    """What a dataset shows of an expert, in the states of a table."""
    if seen is None:
        return {"planner": "unknown: the dataset's"}
    np.savez(folder / "expert.npz", actions=seen.policy)
    planner = f"most {'frequent' if seen.inferred is None else 'likely'} action of the dataset"
    return {"planner": planner, "states_seen": int((seen.visits > 0).sum())}


def recorded_episodes(
    dataset: str, dataset_root: str | None, after_end: AfterEnd, given: list[Episode], demonstrations: list[Episode],
) -> dict[str, Any]:  # fmt: skip
    """The episodes of a dataset, which stays where it is."""
    taken = sum(map(len, demonstrations))
    recorded = {"dataset_id": dataset, "episodes": len(demonstrations), "steps_recorded": taken}
    if any(one.actions is None for one in demonstrations):
        recorded["states_only"] = True
    steps = load_minari(dataset, root=dataset_root).total_steps if after_end == "cut" else None
    return recorded | left_out(given, demonstrations, steps)


def played_episodes(
    folder: Path, teacher: Planner, env: gym.Env, env_id: str, world: RunWorld, expert: Any, gamma: float, episodes: int,
    eval_episodes: int, seed: int,
) -> dict[str, Any]:  # fmt: skip
    """Episodes of an expert that was planned, as a Minari dataset."""
    recorded = world.episodes(expert, episodes, seed)
    chance = world.episodes(world.random, eval_episodes, seed)
    dataset_id, root, lost = dataset_name(env_id), folder / "dataset", unkept(env.spec)
    root.mkdir()
    about = f"Expert demonstrations of {env_id}, gamma {gamma}, seed {seed}."
    write_minari(
        recorded, dataset_id, None if lost else env, root=root, algorithm=type(teacher).__name__,
        observation_space=env.observation_space, action_space=env.action_space,
        description=f"{about} {lost}" if lost else about,
        code_permalink="irl-gym run",
        random_return=float(np.mean([episode.total_reward for episode in chance])),
        expert_return=float(np.mean([episode.total_reward for episode in recorded])),
    )  # fmt: skip
    return {
        "dataset_id": dataset_id,
        "episodes": len(recorded),
        "environment_steps": sum(map(len, recorded)),
        "seed": seed,
        **({"no_environment": lost} if lost else {}),
    }


def learned_outcome(
    folder: Path, learner: Learner, problem: Problem, outcome: Outcome, world: RunWorld, table: Tabulation | None,
    known_expert: Any, from_episodes: bool, env: gym.Env, env_id: str,
) -> dict[str, Any]:  # fmt: skip
    """The reward or the policy that a learner finds, or both, and what it proves."""
    if table is None and outcome.reward is not None and outcome.reward.alpha is None:
        raise InvalidReward("the reward is of rows of a table, and there is none: expected a LinearReward of observations.")
    if outcome.reward is not None:
        outcome.reward.save(folder / REWARD)
    if outcome.policy is not None and world.can_keep(outcome.policy):
        world.keep(outcome.policy, folder, LEARNED)
    known = None if table is None else (table, known_expert)
    certificate = certificate_of(outcome, known, episodes=from_episodes)
    record = {"learner": class_name(learner), "how": outcome_of(learner), **outcome.record()}
    record["policy"] = outcome.policy is not None
    _check_kept(learner, certificate, record)
    write_json(folder / "certificate.json", certificate)
    if table is not None and outcome.reward is not None:
        tabular = outcome.reward.tabular(table.states)
        ShapedReward.of(tabular, table.mdp, certificate["proof"]["terms"].get("margin_cap") or None).save(folder / SHAPED)
    if outcome.labelled:
        record["labels_id"] = dataset_name(env_id, "labels")
        (root := folder / "labels").mkdir()
        paid, seen, acts = table is None or problem.reward is not None, env.observation_space, env.action_space
        write_labelled(
            outcome.labelled, record["labels_id"], env, root=root, observation_space=seen, action_space=acts, paid=paid
        )
    if problem.environment is not None:
        record["stats"]["exact_planner"] = bool(getattr(problem.environment, "exact", False))
    return record


def _check_kept(learner: Learner, certificate: Mapping[str, Any], record: Mapping[str, Any]) -> None:
    """Check what a learner proves and notes before it is written: nothing could read it otherwise.

    Raises:
        InvalidParameter: it is no json, or has an entry that is read and is of another kind.
    """
    try:
        told = json.dumps({"certificate": certificate, "record": record}, allow_nan=False, sort_keys=True, ensure_ascii=False)
        found = json.loads(told.encode())
        checked(found["record"]["stats"], Stats)
        facts_in(checked(found["certificate"], Certificate))
    except (DamagedFile, TypeError, ValueError, RecursionError) as error:
        raise InvalidParameter(
            f"what {class_name(learner)} proves or notes cannot be kept: {error}. Expected json, whose known entries are of "
            "their kind."
        ) from error


def retrained_agent(
    folder: Path, path: Path, retrainer: Planner, world: RunWorld, learned: TabularReward | LinearReward, shaping: bool,
    certificate: Mapping[str, Any], config: Mapping[str, Any], solved: Mapping[str, Any], report_progress: OnProgress,
    warm_start: Literal["clone"] | None, env: gym.Env, demonstrations: list[Episode], seed: int,
) -> dict[str, Any]:  # fmt: skip
    """An agent that is paid by the learned reward only; its learning curve judges it, and does not steer."""
    paid = world.paid(learned, shaped=shaping, margin_cap=certificate["proof"]["terms"].get("margin_cap"))
    kept = Checkpoint(under_way(path, "agent"), {"config": config, "reward": solved.get("sha256", {})})
    kept.seen = glances = Glances(world, _telling(report_progress, "agent", retrainer, kept))
    log = folder / LOGS / "retrained"
    shown = Problem(Spaces(env.observation_space, env.action_space, world.states), demonstrations=demonstrations)
    rng = np.random.default_rng(seed)
    start = None if warm_start is None else lambda model: NeuralClone().learn(shown, rng, model=model)
    policy = world.train(logged(retrainer, log, kept, start), paid, glances.see)
    world.keep(policy, folder, "agent")
    curve = glances.curve()
    write_curve(curve, folder / "learning_curve.csv")
    if isinstance(retrainer, SB3):
        log_scalars(log, curve.steps, {"loop/true_value": curve.value, "loop/mean_return": curve.mean})
    how = how_of(retrainer) + (", from a clone of the demonstrations" if start else "")
    return {"planner": type(retrainer).__name__, "how": how, **_steps(policy, kept)}


def cloned(
    folder: Path, learner: Learner, problem: Problem, world: RunWorld, demonstrations: list[Episode],
    report_progress: OnProgress,
) -> dict[str, Any]:  # fmt: skip
    """A copy of the demonstrations, which is judged beside what was learned; none where that is such a copy itself."""
    if type(learner) is world.cloner:
        return {}
    known = Problem(problem.spaces, demonstrations=demonstrations, dynamics=world.mdp)
    try:
        outcome = world.clone(known, lambda share: report_progress("clone", share, ""))
    except IrlGymError as error:  # one of whoever else is judged would have stopped the run
        return {"no_clone": f"{type(error).__name__}: {error}"}
    world.keep(outcome.policy, folder, CLONE)
    more = {"expert": "had the expert's whole policy", "oracle": "could ask the expert"}
    told = [] if outcome.inferred is None else ["; the actions of these steps are inferred"]
    told += [f"; the learner {what}" for part, what in more.items() if getattr(problem, part) is not None]
    return {"how": f"{outcome.proof.brief}{''.join(told)}"}


def metrics(
    folder: Path, world: RunWorld, expert: Any, agent: Any, learned_policy: Any, clone: Any, given: list[Episode] | None,
    demonstrations: list[Episode], from_episodes: bool, eval_episodes: int, seed: int, table: Tabulation | None,
    horizon: int | None, tabular: TabularReward | None, config: Mapping[str, Any], records: Mapping[str, Mapping[str, Any]],
    certificate: Mapping[str, Any], curve: Curve,
) -> dict[str, Any]:  # fmt: skip
    """How good everything is under the true reward."""
    how = came_about(config, records)
    made = {EXPERT: expert, RANDOM: world.random, CLONE: clone, LEARNED: learned_policy, RETRAINED: agent}
    policies = {name: (one, how[name]) for name, one in made.items() if one is not None or name == EXPERT}
    rows, scale = evaluate(
        policies, world, table, horizon, given=None if given is None else demonstrations, episodes_only=from_episodes,
        episodes=eval_episodes, seed=seed,
    )  # fmt: skip
    content = scorecard(config, records, certificate, rows, scale, curve, table, horizon, tabular, world.limit)
    write_json(folder / "metrics.json", content)
    return {}


def _telling(report_progress: OnProgress, stage: str, planner: Planner, kept: Checkpoint) -> Callable[[int, str], None]:
    """Tells how far a training is, what its agent earns, and where it went on after a kill."""
    total = max(1, getattr(planner, "total_timesteps", 1))

    def tell(steps: int, earned: str) -> None:
        went_on = "" if kept.went_on is None else f"went on at step {kept.went_on:,}"
        report_progress(stage, min(1.0, steps / total), ", ".join(filter(None, (earned, went_on))))

    return tell


def _earned(policy: Policy) -> str:
    """The mean return of the last episodes of a training under the true reward, as SB3 notes it; nothing before the first."""
    noted = policy.model.ep_info_buffer if isinstance(policy, Agent) else None
    return f"mean return {np.mean([one['r'] for one in noted]):.4g}" if noted else ""


def _steps(policy: Policy, kept: Checkpoint) -> dict[str, Any]:
    """Environment steps that a policy was trained on, and those at which it went on in another way than in one go."""
    resumed = {"resumed_at": kept.resumed} if kept.resumed else {}
    return {"environment_steps": policy.model.num_timesteps if isinstance(policy, Agent) else 0, **resumed}
