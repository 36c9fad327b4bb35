"""The loop on environments that publish no table, on small budgets: enumerated, revealed, sampled; and when it is killed."""

import io
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from rich.console import Console
from stopped import HANG

from irl_gym.agents.expert_files import FromFile
from irl_gym.agents.planners import SB3, ValueIteration
from irl_gym.demonstrations.datasets import read_minari
from irl_gym.files.own_files import LOCK, UNFINISHED
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.loop.worlds import discounted_mean
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.experiment import Experiment
from irl_gym.tables.counted.counting import Interaction

SHORT = SB3(total_timesteps=20_000)


class Deck(gym.Env):
    """A user's own: draw from three cards or stop, and the sum is paid unless it is above 5. Observations are a Tuple."""

    observation_space = spaces.Tuple((spaces.Discrete(9), spaces.Discrete(4)))
    action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.sum, self.card = 0, 0
        return (self.sum, self.card), {}

    def step(self, action):
        if action == 0:
            return (self.sum, self.card), float(self.sum), True, False, {}
        self.card = int(self.np_random.integers(1, 4))
        self.sum += self.card
        return (self.sum, self.card), 0.0, self.sum > 5, False, {}


class Shifted(gym.Env):
    """States 1 to 6 in a row, and actions 1 and 2: neither counts from 0."""

    observation_space = spaces.Discrete(6, start=1)
    action_space = spaces.Discrete(2, start=1)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = 2
        return self.at, {}

    def step(self, action):
        up = (action == 2) == (self.np_random.random() < 0.75)
        self.at = max(1, self.at + (1 if up else -1))
        return self.at, float(self.at == 6), self.at == 6, False, {}


@pytest.fixture(scope="module", autouse=True)
def registered():
    for kind in (Deck, Shifted):
        gym.register(f"{kind.__name__}-v0", entry_point=kind, max_episode_steps=50)
    yield
    for kind in (Deck, Shifted):
        del gym.registry[f"{kind.__name__}-v0"]


MINI = "irl_gym_envs:irl_gym/MiniGrid-v0"
ASKED = {
    "blackjack": {"env_id": "Blackjack-v1", "gamma": 0.99},
    "minigrid": {"env_id": MINI, "gamma": 0.95, "env_kwargs": {"task": "Empty-5x5"}},
    "classics": {"env_id": "irl_gym_envs.gym_classics:ClassicGridworld-v0", "gamma": 0.95},
    "deck": {"env_id": "Deck-v0", "gamma": 0.95},
    "shifted": {"env_id": "Shifted-v0", "gamma": 0.9},
    "sampled": {"env_id": "FrozenLake-v1", "gamma": 0.9, "table": Interaction(4_000), "env_kwargs": {"is_slippery": False}},
    "noisy": {"env_id": "Deck-v0", "gamma": 0.95, "epsilon": 0.1},
}
NAMES = tuple(ASKED)


@pytest.fixture(scope="module")
def runs(without_figures, tmp_path_factory):
    """Reports by name, each made when it is asked for."""
    made = {}

    def get(name):
        if name not in made:
            asked = Experiment(**{"episodes": 100, "eval_episodes": 100, "num_envs": 32, "retrain": SHORT, **ASKED[name]})
            made[name] = recover_and_retrain(asked, tmp_path_factory.mktemp("run") / "out")
        return made[name]

    return get


def said(report, width=200):
    console = Console(record=True, width=width, file=io.StringIO())
    print_report(report, console)
    return " ".join(console.export_text().split())


@pytest.mark.parametrize("name", NAMES)
def test_the_agent_is_nearly_as_good_as_the_expert(runs, name):
    assert runs(name).metrics["policies"]["retrained"]["score"] > 0.95


@pytest.mark.parametrize("name", NAMES)
def test_the_expert_is_optimal_under_the_recovered_reward(runs, name):
    assert runs(name).certificate["optimality"]["expert_optimal"]


@pytest.mark.parametrize("name", NAMES)
def test_returns_are_those_of_the_environment(runs, name):
    report = runs(name)
    episodes = list(read_minari(report.metrics["demonstrations"]["dataset"], root=report.out / "dataset"))
    returns = [discounted_mean([one], ASKED[name]["gamma"]) for one in episodes]
    error = np.std(returns) / np.sqrt(len(returns)) + 1e-9
    assert abs(np.mean(returns) - report.metrics["policies"]["expert"]["value"]) < 4 * error


@pytest.mark.parametrize("name", NAMES)
def test_the_table_is_exact_unless_it_was_sampled(runs, name):
    table = runs(name).metrics["table"]
    assert table["exact"] == (name != "sampled") and bool(table["check"]["episodes"]) == (name == "sampled")


def test_what_is_hidden_is_in_the_dataset(runs):
    (first, *_) = read_minari("irl_gym/blackjack-v1-expert-v0", root=runs("blackjack").out / "dataset")
    assert set(first.observations) == {"observation", "natural"}


# --- experts that err, and experts from files ---


def test_a_noisy_expert_takes_a_random_action_in_its_share_of_states(runs):
    row = runs("noisy").metrics["policies"]["expert"]
    table = np.load(runs("noisy").out / "expert.npz")["actions"]
    assert table.max(axis=1) == pytest.approx(0.95) and 0.9 < row["agreement"] < 1.0


def test_the_agent_of_a_noisy_expert_is_better_than_it(runs):
    policies = runs("noisy").metrics["policies"]
    assert policies["retrained"]["value"] > policies["expert"]["value"] and runs("noisy").metrics["reward"]["slack"] is None


@pytest.mark.parametrize("file", ["agent.zip", "agent_policy.npz", "expert.npz"])
def test_an_expert_may_be_what_another_run_left(runs, tmp_path, file):
    first = runs("deck")
    asked = Experiment("Deck-v0", 0.95, expert=FromFile.at(str(first.out / file)), episodes=20, retrain=ValueIteration())
    again = recover_and_retrain(asked, tmp_path / "run")
    of = "expert" if file.startswith("expert") else "retrained"
    assert again.metrics["policies"]["expert"]["value"] == pytest.approx(first.metrics["policies"][of]["value"])
    assert again.stages["expert"] | {"seconds": 0, "files": [], "sha256": {}} == {
        "planner": "FromFile", "how": "read from a file", "environment_steps": 0, "seconds": 0, "files": [], "sha256": {}
    }  # fmt: skip


# --- what the report says ---

SAID = {
    "blackjack": ("value: exact", "one of the expert's actions", "reachable states, 2 actions", "expert = 1"),
    "minigrid": ("table: [0-9]+ reachable states, 7 actions. Enumeration of",),
    "sampled": (
        "computed on a table that is an estimate",
        "Counts of 4000 steps",
        "Probabilities within",
        "value by episodes",
        "a counted table, margins within .* with 95 % confidence if later values are right",
        "│ retrained │ .*│ not known │",
        "loses at most: of value against the policy that is best by the table",
        "sampling noise",
        "Hidden state none seen",
        "fresh episodes",
    ),
    "noisy": (
        "expert with its errors = 1",
        "an optimal action",
        "taken for the expert's │ the actions most frequent in its episodes",
        "none: it gains",
    ),
}


@pytest.mark.parametrize("name", SAID)
@pytest.mark.parametrize("width", [80, 120])
def test_the_report_says(runs, name, width):
    text = said(runs(name), 300)
    assert [words for words in SAID[name] if not re.search(words, text)] == [] and "exact on" not in text
    assert said(runs(name), width)


def test_the_page_says_that_a_counted_table_judged(runs):
    text = " ".join(Path(runs("sampled").page).read_text().split())
    assert "All this is judged on a counted table, margins within" in text and "value by episodes (95 %)" in text
    assert "Episodes that were not counted do not tell what the agent loses" in text
    assert "counted table" not in Path(runs("deck").page).read_text()


# --- killed ---

KILLED = """
import os, signal, sys
import gymnasium as gym
import numpy as np
from gymnasium import spaces
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.runs.experiment import Experiment
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.agents.planners import ValueIteration

class Counted(gym.Env):
    observation_space, action_space = spaces.MultiDiscrete([12, 12]), spaces.Discrete(4)
    steps = 0
    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x, self.y = 6, 6
        return np.array((self.x, self.y)), {}
    def step(self, action):
        Counted.steps += 1
        if Counted.steps == dies_at:
            os.kill(os.getpid(), signal.SIGKILL)
        dx, dy = ((0, 1), (1, 0), (0, -1), (-1, 0))[action]
        self.x, self.y = min(max(self.x + dx, 0), 11), min(max(self.y + dy, 0), 11)
        end = self.x == self.y == 11
        return np.array((self.x, self.y)), float(end), end, False, {}

gym.register("Counted-v0", entry_point=Counted, max_episode_steps=150)
asked = Experiment("Counted-v0", 0.9, episodes=5, eval_episodes=5, retrain=ValueIteration(), table=Enumeration(every=0))
told = []
recover_and_retrain(asked, out, lambda *one: told.append(one))
"""


def test_an_enumeration_that_was_killed_continues_and_ends_in_the_same_bytes(without_figures, unchecked, tmp_path):
    def given(out, dies_at=0):
        return {"__name__": "killed", "out": str(tmp_path / out), "dies_at": dies_at}

    def start(out):
        exec(KILLED, here := given(out))
        del gym.registry["Counted-v0"]
        return [int(one) for one in re.findall(r"\d+", here["told"][1][2])]

    half = tmp_path / "killed" / ".enumeration.tmp.npz"
    code = f"exec({KILLED!r}, {given('killed', 8_000)!r})"
    killed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=HANG)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    left = {path.name for path in (tmp_path / "killed").iterdir() if not UNFINISHED.fullmatch(path.name)}
    assert left == {half.name, LOCK}  # the system has let go of the lock
    killed, fresh = start("killed"), start("fresh")
    assert killed[0] == killed[1] and fresh[0] > fresh[1]  # states found, and tried, as they were first told
    for name in ("metrics.json", "certificate.json", "reward.npz", "config.json"):
        first, second = ((tmp_path / out / name).read_bytes() for out in ("killed", "fresh"))
        assert first == second, (json.loads(first), json.loads(second)) if name == "metrics.json" else name
