"""What next: each command and each line that the first screen names runs; and what it is called."""

import shlex
from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import table_run
from reports.page.test_first_screen import HEALTHY, found, with_reward

from irl_gym.commands.arguments import Arguments
from irl_gym.commands.terminal import read_arguments
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.mdp.policies import load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.python_code import reward_lines
from irl_gym.reports.page.sections.next_step import next_step
from irl_gym.runs.named_parts import environment_of
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied
from irl_gym.tables.table_files import save_table
from irl_gym.tables.tabulate import tabulate


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("lake"), errors=0, films=False)


def next_of(run, **changes):
    return supplied(next_step, RunContents(run), replace(run, **changes))


def asked_by(line):
    """The experiment that a line of a shell asks for."""
    program, subcommand, *words = shlex.split(line)
    assert (program, subcommand) == ("irl-gym", "run")
    return read_arguments(Arguments, words, "run", None).experiment()


@pytest.mark.parametrize(
    ("command", "flags", "expected"),
    [
        ("--l1 5 --seed 3", ["--margin-cap auto", "--l1 0"], {"l1": 0.0, "seed": 3}),
        ("--learner=feature-lp --features fourier --size 3", ["--learner finite-lp", "--l1 0"], {"type": "FiniteLP"}),
        ("--no-shaping", ["--shaping"], {"shaping": True}),
        ("--episodes 20 --epsilon 0.1", ["--episodes", "--epsilon"], {"episodes": 40, "epsilon": 0.0}),
        ("--out runs/mine --env-kwargs map_name=4x4", ["--gamma 0.9"], {"gamma": 0.9, "env_kwargs": {"map_name": "4x4"}}),
    ],
)
def test_the_first_mend_is_the_run_s_own_command_with_its_flags(healthy, command, flags, expected):
    version = {**healthy.version, "command": ["irl-gym", "run", *command.split()]}
    told = next_of(healthy, diagnosis=found(*flags), version=version, config={**healthy.config, "episodes": 10})
    made = asked_by(told["lines"])
    has = {"l1": getattr(made.learner, "l1", None), "type": type(made.learner).__name__}
    has |= {key: getattr(made, key) for key in ("seed", "shaping", "episodes", "epsilon", "gamma", "env_kwargs")}
    assert told["answer"] == "Mend it" and "Tied in s=6 a=2 (" in told["sentence"] and "--out" not in told["lines"]
    assert {key: has[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("command", "flags"),
    [
        (["irl-gym", "run"], ["--features"]), (["irl-gym", "run", "--learner", "trajectory-lp"], ["--margin-cap auto"]),
        (["irl-gym", "run", "--learner", "my:Own"], ["--l1 0"]), (["rm", "-r"], ["--l1 0"]), (None, ["--l1 0"]),
    ],
)  # fmt: skip
def test_a_mend_that_would_not_run_is_told_in_words(healthy, command, flags):
    told = next_of(healthy, diagnosis=found(*flags), version={**healthy.version, "command": command})
    assert told["lines"] is None and "Mend: Capped." in told["sentence"]


def test_a_finding_that_a_command_mends_goes_before_one_that_none_does(healthy):
    first, second = (found(flag)["findings"][0] for flag in ("--features", "--l1 0"))
    told = next_of(healthy, diagnosis={**HEALTHY, "answer": "findings", "findings": [first, second]})
    assert told["lines"].endswith("--l1 0") and "first finding that a command mends" in told["sentence"]


def test_an_agent_that_fell_short_of_its_reward_is_planned(tmp_path):
    run = with_reward(table_run(tmp_path, errors=11, films=False), worst_tie_regret_share=0.0)
    told = next_of(run, diagnosis=HEALTHY)
    assert told["answer"] == "Train the agent better" and type(asked_by(told["lines"]).retrain).__name__ == "ValueIteration"


def test_the_lines_that_use_a_reward_run_in_the_folder_of_the_run(finished, monkeypatch):
    run = with_reward(read_run(finished), worst_tie_regret_share=None)  # else its agent is to be planned
    told = next_of(run, diagnosis=HEALTHY)
    assert told["answer"] == "Use the reward" and "reward_shaped.npz" in told["lines"]
    monkeypatch.chdir(finished)
    made = {}
    exec(told["lines"], made)
    env = made["env"]
    env.reset(seed=0)
    *_, info = env.step(0)
    assert isinstance(env, LearnedReward) and "learned_reward" in info
    env.close()


def test_the_lines_that_use_a_reward_take_arguments_of_the_environment(tmp_path, monkeypatch):
    run = table_run(tmp_path, films=False, map_name="4x4", is_slippery=False)
    run.learned.save(tmp_path / "reward.npz")
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(next_of(run, diagnosis=HEALTHY)["lines"], made)
    assert made["env"].spec.kwargs["is_slippery"] is False
    made["env"].close()


def test_the_lines_of_an_environment_that_hides_something_show_it(tmp_path, monkeypatch):
    config = {"env_id": "Blackjack-v1", "env_kwargs": {"natural": True, "sab": False}}
    env = environment_of(*config.values())
    table = tabulate(env, gamma=0.9, check_steps=0)
    TabularReward(np.zeros(table.mdp.n_states)).save(tmp_path / "reward.npz")
    save_table(table, tmp_path / "table.npz")
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(
        reward_lines({"env_id": "Blackjack-v1", "env_kwargs": {"natural": True, "sab": False}}, "reward.npz", table.states),
        made,
    )
    made["env"].reset(seed=0)
    assert made["env"].observation_space == env.observation_space and made["env"].step(0)[1] == 0.0


def test_the_lines_that_use_a_policy_run_in_the_folder_of_the_run(policy_run, monkeypatch):
    run = read_run(policy_run("policy"))
    told = next_of(run)
    assert told["answer"] == "Use the policy"
    monkeypatch.chdir(run.path)
    made = {}
    exec(told["lines"], made)
    assert np.array_equal(made["policy"], load_actions(run.path / "learned_policy.npz"))
