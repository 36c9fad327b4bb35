"""The first screen: three questions with answers that are computed, or say whose record they are; and what to do next."""

import shlex
from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import section_of, stepped_run, table_run, verdict_of

from irl_gym.commands.arguments import Arguments
from irl_gym.commands.terminal import read_arguments
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.mdp.policies import load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.python_code import reward_lines
from irl_gym.reports.page.report import write_report
from irl_gym.reports.page.sections.compared import rewards
from irl_gym.reports.page.sections.next_step import next_step
from irl_gym.runs.named_parts import environment_of
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied
from irl_gym.tables.table_files import save_table
from irl_gym.tables.tabulate import tabulate

HEALTHY = {"answer": "healthy", "why": None, "examined": "Examined: it.", "findings": []}
NOBODY = {"answer": "not examined", "why": "it is gone", "examined": "", "findings": []}


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    run = table_run(tmp_path_factory.mktemp("lake"), errors=0, films=False)
    return replace(run, diagnosis=HEALTHY, recomputed=True)


def with_reward(run, **changes):
    return replace(run, metrics={**run.metrics, "reward": {**run.metrics["reward"], **changes}})


def found(*flags, name="ties"):
    told = {"name": name, "sentence": "Tied in {where}.", "mend": "Capped.", "states": [6], "actions": [2]}
    return {**HEALTHY, "answer": "findings", "findings": [{**told, "flags": [*flags]}]}


def trusted(run):
    return verdict_of(run)["questions"][1]


def next_of(run, **changes):
    return supplied(next_step, RunContents(run), replace(run, **changes))


def asked_by(line):
    """The experiment that a line of a shell asks for."""
    program, subcommand, *words = shlex.split(line)
    assert (program, subcommand) == ("irl-gym", "run")
    return read_arguments(Arguments, words, "run", None).experiment()


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, "Yes"), ({"worst_tie_regret_share": 0.2}, "With care"), ({"worst_tie_regret_share": None}, "With care"),
        ({"unsettled_states": 2}, "With care"), ({"expert_optimal": None}, "Not decided"), ({"expert_optimal": False}, "No"),
        ({"degenerate": True}, "No"),
    ],
)  # fmt: skip
def test_a_reward_is_trusted_only_where_nothing_is_against_it(lake, changes, answer):
    settled = {"worst_tie_regret_share": 0.0, "expert_optimal": True, "degenerate": False}
    assert trusted(with_reward(lake, **{**settled, **changes}))["answer"] == answer


@pytest.mark.parametrize("diagnosis", [None, NOBODY, found("--l1 0")])
def test_a_reward_that_the_doctor_did_not_find_healthy_is_trusted_with_care(lake, diagnosis):
    sure = with_reward(lake, worst_tie_regret_share=0.0, expert_optimal=True, degenerate=False)
    assert trusted(replace(sure, diagnosis=diagnosis))["answer"] == "With care"


def test_a_reward_on_an_estimated_table_is_trusted_with_care(lake):
    sure = with_reward(lake, worst_tie_regret_share=0.0, expert_optimal=True, degenerate=False)
    table = {**sure.metrics["table"], "exact": False, "counted": True}
    assert trusted(replace(sure, metrics={**sure.metrics, "table": table}))["answer"] == "With care"


def test_what_the_page_did_not_compute_is_the_record_of_the_run(lake):
    (first, *_), (other, *_) = (trusted(replace(lake, recomputed=again))["sentences"] for again in (True, False))
    assert other == first.replace(".", ", by the run's own record.")


def test_without_a_table_it_is_not_decided_whether_the_reward_is_to_be_trusted(tmp_path):
    told = trusted(stepped_run(tmp_path))
    assert told["answer"] == "Not decided" and told["sentences"][1].startswith("By its learner's own record, ")


def test_the_first_screen_is_the_top_of_the_page_and_fits_both_widths(lake, look, tmp_path):
    write_report(lake, tmp_path / "page.html")
    for width in (1280, 390):
        page = look(tmp_path / "page.html", width=width)
        asked = page.locator(".question h3").all_inner_texts()
        assert asked == ["Does the agent do as well as the expert?", "Is the reward to be trusted?", "What next?"]
        if width == 1280:
            assert page.locator(".question").last.bounding_box()["y"] < 844


# --- what next ---


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
def test_the_first_mend_is_the_run_s_own_command_with_its_flags(lake, command, flags, expected):
    version = {**lake.version, "command": ["irl-gym", "run", *command.split()]}
    told = next_of(lake, diagnosis=found(*flags), version=version, config={**lake.config, "episodes": 10})
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
def test_a_mend_that_would_not_run_is_told_in_words(lake, command, flags):
    told = next_of(lake, diagnosis=found(*flags), version={**lake.version, "command": command})
    assert told["lines"] is None and "Mend: Capped." in told["sentence"]


def test_a_finding_that_a_command_mends_goes_before_one_that_none_does(lake):
    first, second = (found(flag)["findings"][0] for flag in ("--features", "--l1 0"))
    told = next_of(lake, diagnosis={**HEALTHY, "answer": "findings", "findings": [first, second]})
    assert told["lines"].endswith("--l1 0") and "first finding that a command mends" in told["sentence"]


def test_an_agent_that_fell_short_of_its_reward_is_planned(tmp_path):
    run = with_reward(table_run(tmp_path, errors=11, films=False), worst_tie_regret_share=0.0)
    told = next_of(run, diagnosis=HEALTHY)
    assert told["answer"] == "Train the agent better" and type(asked_by(told["lines"]).retrain).__name__ == "ValueIteration"


def test_the_lines_that_use_a_reward_run_in_the_folder_of_the_run(finished, monkeypatch):
    run = with_reward(read_run(finished), worst_tie_regret_share=None)  # else its agent is to be planned
    lines = next_of(run, diagnosis=HEALTHY)["lines"]
    assert "reward_shaped.npz" in lines
    monkeypatch.chdir(finished)
    made = {}
    exec(lines, made)
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


def test_a_learner_of_a_policy_is_asked_of_its_policy(policy_run, monkeypatch):
    run = read_run(policy_run("policy"))
    questions = [one["question"] for one in verdict_of(run)["questions"]]
    assert questions == ["Does the policy do as well as the expert?", "Is the policy to be trusted?"]
    lines = next_of(run)["lines"]
    monkeypatch.chdir(run.path)
    made = {}
    exec(lines, made)
    assert np.array_equal(made["policy"], load_actions(run.path / "learned_policy.npz"))


# --- why a goal may earn less than a hole ---


def test_a_goal_that_has_less_than_a_hole_is_explained_where_it_is_so(lake):
    mdp, values = lake.table.mdp, np.zeros(lake.table.mdp.n_states)
    goal = int(np.argmax((mdp.P.T @ lake.table.reward.expected(mdp).ravel()) * mdp.terminal))
    hole = int(np.flatnonzero(mdp.terminal & (np.arange(mdp.n_states) != goal))[0])
    values[hole] = 0.5
    odd = with_reward(replace(lake, learned=TabularReward(values)), expert_optimal=True, degenerate=False)
    assert "has 0.5. That is no fault: a reward says which actions are best" in section_of(rewards, odd).lead
    values[goal] = 0.75
    usual = replace(odd, learned=TabularReward(values))
    assert "no fault" not in section_of(rewards, usual).lead


def test_a_goal_is_not_explained_by_a_reward_that_does_not_explain_the_expert(lake):
    odd = with_reward(replace(lake, learned=TabularReward(np.linspace(1, 0, lake.table.mdp.n_states))), expert_optimal=False)
    assert "no fault" not in section_of(rewards, odd).lead
