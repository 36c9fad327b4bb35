"""Where an experiment takes place: tables are kept, read again, made again when damaged, and never another experiment's."""

import json
from dataclasses import replace
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.agents.planners import SB3
from irl_gym.errors import EnumerationLimit, HiddenState, InvalidParameter, NotDiscrete, NotTabular, RunConflict
from irl_gym.features.bases import RadialBasis
from irl_gym.files.own_files import held
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.loop.loop import Loop
from irl_gym.loop.table_world import TableWorld
from irl_gym.loop.worlds import SteppedWorld
from irl_gym.runs.experiment import Experiment
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.table_files import TABLE, UNDER_WAY, kept_table, load_table
from irl_gym.tables.tabulate import tabulate


class Walk(gym.Env):
    """A walk of n cells; `steps` counts those of all copies, and `broken` makes each an error."""

    steps, broken = 0, False

    def __init__(self, n=6, hidden=False, starts=1):
        self.n, self.hidden, self.starts = n, hidden, starts
        self.observation_space, self.action_space = spaces.MultiDiscrete([n, 2]), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at, self.clock = int(self.np_random.integers(self.starts)), 0
        return self.seen(), {}

    def seen(self):
        return np.array([self.at, self.at % 2])

    def step(self, action):
        Walk.steps += 1
        if Walk.broken:
            raise RuntimeError("stepped")
        self.clock = (self.clock + 1) % 5 if self.hidden else 0
        self.at = int(np.clip(self.at + (1 if action else -1), 0, self.n - 1))
        return self.seen(), float(self.at == self.n - 1 and self.clock < 3), self.at == self.n - 1, False, {}


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setitem(gym.registry, "Walk-v0", gym.envs.registration.EnvSpec("Walk-v0", Walk, max_episode_steps=30))
    monkeypatch.setattr(Walk, "steps", 0)
    monkeypatch.setattr(Walk, "broken", False)
    monkeypatch.setattr("irl_gym.loop.world_choice.tabulate", partial(tabulate, check_steps=100))


def walk(**asked):
    return Experiment(**{"env_id": "Walk-v0", "gamma": 0.9, "episodes": 5, "eval_episodes": 5, **asked})


def begun(asked, out, *more):
    """A run's loop, made in a folder that is held, as a run has it."""
    with held(out, "busy"):
        return Loop(asked, out, *more)


def same(first, second):
    return (first.mdp.P != second.mdp.P).nnz == 0 and np.array_equal(first.reward.values, second.reward.values)


def test_a_table_is_kept_and_read_at_the_second_start(tmp_path):
    first = begun(walk(), tmp_path / "run").world
    Walk.broken = True
    second = begun(walk(), tmp_path / "run").world
    assert same(first.table, second.table) and first.table.evidence == second.table.evidence
    assert first.table.states.numbers.tolist() == second.table.states.numbers.tolist()


def test_a_table_is_kept_whole(tmp_path):
    begun(walk(), tmp_path / "run")
    assert load_table(tmp_path / "run" / TABLE, gym.make("Walk-v0").observation_space).mdp.n_states == 6
    assert not [path for path in (tmp_path / "run").iterdir() if ".tmp" in path.name]


@pytest.mark.parametrize("damage", [b"", b"nothing", None])
def test_a_table_that_is_damaged_is_made_again(tmp_path, damage):
    first = begun(walk(), tmp_path / "run").world
    kept = tmp_path / "run" / TABLE
    content = kept.read_bytes()
    kept.write_bytes(content[: len(content) // 2] if damage is None else damage)
    assert same(first.table, begun(walk(), tmp_path / "run").world.table) and kept.read_bytes() == content


def test_a_table_of_which_a_byte_is_changed_is_not_taken_or_is_the_same(tmp_path):
    first = begun(walk(), tmp_path).world
    content, rng = (tmp_path / TABLE).read_bytes(), np.random.default_rng(0)
    for place in rng.integers(len(content), size=100):
        damaged = bytearray(content)
        damaged[place] ^= int(rng.integers(1, 256))
        (tmp_path / TABLE).write_bytes(bytes(damaged))
        found = kept_table(tmp_path, first.env.observation_space)
        assert same(found, first.table) if found is not None else not (tmp_path / TABLE).exists()


@pytest.mark.parametrize("other", [{"gamma": 0.8}, {"env_kwargs": {"n": 7}}, {"seed": 3}])
def test_another_experiment_that_takes_over_a_folder_makes_its_own_table(tmp_path, other):
    begun(walk(), tmp_path / "run")  # no stage is finished: nothing is lost
    world = begun(walk(**other), tmp_path / "run").world
    assert (world.gamma, world.table.mdp.n_states) == (other.get("gamma", 0.9), 7 if "env_kwargs" in other else 6)


@pytest.mark.parametrize("other", [{"gamma": 0.8}, {"table": Interaction(50)}, {"epsilon": 0.2}, {"start_seeds": (0,)}])
def test_another_experiment_is_refused_before_any_work_when_a_stage_is_finished(tmp_path, other):
    begun(walk(), tmp_path / "run").stage("expert")
    kept, Walk.broken = (tmp_path / "run" / TABLE).read_bytes(), True
    with pytest.raises(RunConflict, match=f"its {next(iter(other))}"):
        begun(walk(**other), tmp_path / "run")
    assert (tmp_path / "run" / TABLE).read_bytes() == kept


@pytest.mark.parametrize("name", ["notes.txt", "run"])
def test_a_folder_of_something_else_is_refused_before_any_work(tmp_path, name):
    (tmp_path / name).write_text("mine")
    out, Walk.broken = tmp_path if name == "notes.txt" else tmp_path / name, True
    with pytest.raises(RunConflict, match="holds no run"):
        Loop(walk(), out)
    assert [path.name for path in tmp_path.iterdir()] == [name]


# --- refusals leave nothing ---


@pytest.mark.parametrize(
    ("asked", "error", "match"),
    [
        (
            {"env_kwargs": {"hidden": True}},
            HiddenState,
            r"clock: 4 against 2.*--reveal name=number, --table sample.*--learner trajectory-lp",
        ),
        ({"env_id": "CartPole-v1"}, NotDiscrete, r"--bins 5.*--learner trajectory-lp"),
        ({"env_id": "Blackjack-v1", "reveal": {}}, NotTabular, "Reveal"),
        ({"env_id": "FrozenLake-v1", "bins": 5}, InvalidParameter, "Leave bins out"),
        ({"reveal": {"clocks": 5}}, InvalidParameter, "closest to it are clock"),
    ],
)
def test_a_run_that_is_refused_leaves_no_folder(tmp_path, asked, error, match):
    with pytest.raises(error, match=match):
        begun(walk(**asked), tmp_path / "runs" / "one")
    assert not any(tmp_path.iterdir())


def test_what_is_hidden_is_shown_when_it_is_asked_for(tmp_path):
    asked = walk(env_kwargs={"hidden": True}, reveal={"clock": 5})
    assert begun(asked, tmp_path / "run").world.table.mdp.n_states > 6


def test_an_environment_that_hides_something_is_stepped_when_the_learner_needs_no_table(tmp_path):
    learner = TrajectoryLP(RadialBasis.grid([0, 0], [5, 1], 2))
    world = begun(walk(env_kwargs={"hidden": True}, learner=learner), tmp_path / "run").world
    assert isinstance(world, SteppedWorld)


def test_an_enumeration_past_its_limit_is_kept_and_continued_with_a_larger_one(tmp_path):
    few, more = (walk(env_kwargs={"n": 40}, table=Enumeration(max_states=n)) for n in (30, 40))
    with pytest.raises(EnumerationLimit, match=r"31 states found.*--max-states, with --out"):
        begun(few, tmp_path / "run")
    assert [path.name for path in (tmp_path / "run").iterdir()] == [UNDER_WAY]
    world = begun(more, tmp_path / "run").world
    assert same(world.table, begun(more, tmp_path / "fresh").world.table) and not (tmp_path / "run" / UNDER_WAY).exists()
    assert json.loads((tmp_path / "run" / "config.json").read_text())["table"]["max_states"] == 40


def test_a_checkpoint_of_ones_own_is_kept(tmp_path):
    mine = tmp_path / "mine.npz"
    begun(walk(table=Enumeration(checkpoint=str(mine))), tmp_path / "run")
    assert mine.exists()


# --- ways to make a table ---


def test_a_sampled_table_is_an_estimate_and_is_kept(tmp_path):
    asked = walk(table=Interaction(400, seed=1))
    world = begun(asked, tmp_path / "run").world
    Walk.broken = True
    assert isinstance(world, TableWorld) and not world.table.evidence.exact
    assert same(world.table, begun(asked, tmp_path / "run").world.table)


@pytest.mark.parametrize(("table", "method"), [(None, "publishes as P"), (Enumeration(), "Enumeration of 11 states")])
def test_what_is_known_of_an_environment_is_asked_unless_enumeration_is(tmp_path, table, method):
    world = begun(replace(walk(), env_id="FrozenLake-v1", table=table), tmp_path / "run").world
    assert method in world.table.evidence.method and world.table.evidence.exact


def test_start_seeds_make_the_starts(tmp_path):
    world = begun(walk(env_kwargs={"starts": 5}, start_seeds=(3, 8)), tmp_path / "run").world
    for seed in (3, 8):
        start, _ = gym.make("Walk-v0", starts=5).reset(seed=seed)
        assert world.table.mdp.d0[world.table.states.encode(start)] == 0.5


def test_progress_grows_up_to_1(tmp_path):
    told = []
    begun(walk(table=Interaction(400)), tmp_path / "run", lambda stage, share, known: told.append(share))
    assert told == sorted(told) and told[0] == 0.0 and told[-1] == 1.0


def test_an_enumeration_tells_the_states_found_and_no_share_of_what_is_not_known(tmp_path):
    told = []
    begun(walk(), tmp_path / "run", lambda *one: told.append(one))
    assert told[0] == ("table", 0.0, "") and told[-1] == ("table", 1.0, "6 states")
    assert {share for _, share, _ in told[1:-1]} == {None} and told[-2][2] == "5 states found, 5 tried"


def test_copies_are_as_many_as_asked_for(tmp_path):
    assert begun(walk(num_envs=3, retrain=SB3()), tmp_path / "run").world.num_envs == 3
