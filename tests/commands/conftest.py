"""The command `irl-gym` in this process, and a folder with a user's own modules."""

import re
import sys
from types import SimpleNamespace

import gymnasium
import pytest

MODULES = {
    "own_env_here": """
import gymnasium as gym
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv

class Pond(FrozenLakeEnv):
    def __init__(self, render_mode=None):
        super().__init__(render_mode, desc=["SF", "HG"])

class Fog(gym.Env):
    observation_space, action_space = gym.spaces.Discrete(3), gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.key, self.at = 0, 0
        return self.at, {}

    def step(self, action):
        if action == 0:
            self.key, self.at = 1, 1 - self.at
        elif self.key and self.at == 0:
            self.at = 2
        return self.at, float(self.at == 2), self.at == 2, False, {}

gym.register("Pond-v0", entry_point="own_env_here:Pond", max_episode_steps=50)
gym.register("Fog-v0", entry_point="own_env_here:Fog", max_episode_steps=50)
""",
    "own_learner_here": """
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from irl_gym.learners.linear_programs.finite import FiniteLP

@dataclass(frozen=True)
class Twin:
    needs: ClassVar = FiniteLP.needs
    def learn(self, problem, rng):
        return FiniteLP().learn(problem, rng)

class Asker(Twin):
    needs: ClassVar = replace(FiniteLP.needs, required=("dynamics", "oracle"))
    def learn(self, problem, rng):
        actions = [problem.oracle.ask(state) for state in range(problem.dynamics.n_states)]
        return FiniteLP().fit(problem.dynamics, np.array(actions))

class Knower(Twin):
    needs: ClassVar = replace(FiniteLP.needs, required=("dynamics", "expert"))
    def learn(self, problem, rng):
        return FiniteLP().fit(problem.dynamics, problem.expert)

class Broken(Twin):
    def learn(self, problem, rng):
        return np.zeros(3)[7]
""",
}

STAGE = re.compile(r"[a-z0-9 ]+: (begun|done in |\d+ ?%|\d+ s, |[\d.]+ s)")
"""How a line begins that says how far a stage is."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder but for a user's own modules, in which the user stands."""
    for name, text in MODULES.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(sys, "modules", sys.modules)
    yield tmp_path
    for name in ("Pond-v0", "Fog-v0"):
        gymnasium.registry.pop(name, None)
    for name in MODULES:
        sys.modules.pop(name, None)


@pytest.fixture
def irl_gym(here, capsys, monkeypatch, unchecked):
    """The command: what it returns and says, but for how far its stages are. Runs draw no figures, which take the time."""
    from irl_gym.commands import door  # here, so that the filter of pytest_configure is in force
    from irl_gym.loop import loop

    monkeypatch.setitem(loop.MAKERS, "figures", ())

    def call(*words):
        try:
            code = door.main([*map(str, words)])
        except SystemExit as ended:
            code = ended.code or 0
        said = capsys.readouterr()
        told = [line for line in said.err.splitlines(keepends=True) if not STAGE.match(line)]
        return SimpleNamespace(code=code, out=said.out, errors="".join(told))

    return call
