"""The closed loop in one call: environment -> expert -> Minari -> LP-IRL -> reward -> SB3 -> how good it is."""

import os
from collections.abc import Sequence
from pathlib import Path

from irl_gym.environments.reveal import shown_by
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.files.own_files import held
from irl_gym.loop.loop import Loop
from irl_gym.loop.stages import OnProgress
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.identity import STAGES
from irl_gym.runs.run import read_run
from irl_gym.runs.summary import Report


def recover_and_retrain(
    experiment: Experiment,
    out: str | os.PathLike,
    on_progress: OnProgress | None = None,
    command: Sequence[str] | None = None,
) -> Report:
    """Recover a reward from an expert, retrain an agent on it, and judge the agent under the true reward.

    Leaves under `out`:
        config.json, run.json, environment.json       what was asked, who wrote it, where it took place
        table.npz, expert.npz, dataset/ (Minari)      expert.zip where there is no table; a dataset given is not copied
        reward.npz, certificate.json                  what was learned; learned_policy.npz of a learner that gives a policy
        labels/ (Minari)                              episodes in which an oracle was asked, of a learner that asks
        reward_shaped.npz                             what to train an agent of one's own on: LearnedReward(env, this file)
        agent.zip, agent_policy.npz                   who was retrained; agent.shown.npz where it was shown rows of states
        clone_policy.npz                              who copies the demonstrations; clone.zip where there is no table
        learning_curve.csv, tensorboard/              how
        metrics.json, metrics.csv, figures/           how good it is
        films/, grid.json                             episodes to watch; the map of a grid
        diagnosis.json, ambiguity.npz                 what the doctor says; for small tables, how far the reward is left open
        report.html                                   all of it, on a page
    The same seed and command leave the same bytes, but for agents in zips and tensorboard/, which hold the time, and for the
    seconds that stages took, in .stages/ and in report.html's table of them. A run that was killed goes on after its last
    stage, and inside the training of an agent, of which at most a twentieth and one rollout are repeated. On a table that
    leaves the same bytes too; where the environment is stepped its episodes begin anew, and the run says at which step.
    .stages/ has the sha256 of every file that is read again: one that is another is named, and nothing is made from it.

    Args:
        experiment: what to do.
        out: a new or empty folder, or one that holds this same experiment.
        on_progress: called with a stage, the share of it that is done (None where that cannot be known), and what else is
            known, such as the agent's mean return.
        command: the command that reproduces the run, kept in run.json; None where it is started from Python.

    Raises:
        InvalidParameter: no experiment.
        UnknownEnvironment, NotTabular, NotDiscrete, TableMismatch: no table can be made, and the learner needs one.
        DatasetMissing, DatasetMismatch: no such dataset, or one of another environment.
        DegenerateExpert: no reward prefers the expert's actions.
        SolverTimeout, SolverFailed: a linear program without an answer.
        RunConflict: the folder holds another run, another process works in it, or a link in it leads out of it.
        RunIncomplete: the run was finished before, and what it says of itself is not what its files give.
        RunNewer: the folder holds a run of a newer version.
        WriteFailed: the disk became full, or the folder was deleted meanwhile.
    """
    if not isinstance(experiment, Experiment):
        raise InvalidParameter(
            f"experiment is {a_type(experiment)}: expected an Experiment. Make one, such as "
            "`irl_gym.Experiment('FrozenLake-v1', gamma=0.99)`."
        )
    with held(Path(out), f"another process works in {out}: wait for it, or choose another --out."):
        loop = Loop(experiment, out, on_progress, command)
        stages = {"table": {"seconds": loop.table_seconds}} | {name: loop.stage(name) for name in STAGES}
        metrics, certificate, whose = loop.judged, loop.certificate, None
        if stages["report"].get("kept"):  # it may have been changed since
            run = read_run(loop.path, loop.world.table)
            metrics, certificate, whose = run.metrics, run.certificate, run.whose
    return Report(loop.path, metrics, certificate, stages, experiment.to_json(), shown_by(loop.env), whose)
