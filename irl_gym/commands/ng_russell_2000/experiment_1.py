"""Experiment 1 of Ng & Russell (2000), figures 1 and 2: the 5 x 5 grid and the linear program of section 3.2.

    maximise    sum_s min_{a != pi(s)} (P_pi(s) - P_a(s)) V - lambda ||R||_1
    subject to  (4): (P_pi - P_a) V >= 0 for each a;   V = (I - gamma P_pi)^-1 R (5);   |R(s)| <= R_max = 1
Conventions, those that reproduce the printed figure; `alternatives` measures what others give:
    discount    gamma = 0.9, which the paper does not print
    noise       with 30 % a uniform one of all four moves, so 0.775 for the chosen one and 0.075 for each other
    edges       a move off the grid stays
    goal        the upper right corner is terminal: V = R there, so the reward is paid once
    expert      value iteration, ties broken up before right before down before left; not the arrows printed in figure 1
The numbers read off the paper's figure are of its panel with lambda = 0, to its resolution; lambda = 1.05 is "just below"
lambda_0, the price above which R = 0 is optimal. Axes: rows and columns of the grid, top row first.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import product
from typing import Any

import gymnasium as gym
import numpy as np
import scipy.sparse as sp

from irl_gym.commands.ng_russell_2000.records import Check, Progress, at_most, near, reported
from irl_gym.judging.metrics import optimal_actions
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import Reward, value_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.tabulate import make, tabulate
from irl_gym.tables.tabulation import Tabulation

ENVIRONMENT = "irl_gym_envs:irl_gym/GridWorld-v0"
UP, RIGHT, DOWN, LEFT = range(4)
PRINTED = np.array([
    [-1.0, -1.0, -1.0, 0.211, 1.0],
    [-0.992, -1.0, 0.138, -0.925, -1.0],
    [-0.225, -1.0, -0.996, -1.0, -1.0],
    [-0.945, -1.0, -1.0, -1.0, -1.0],
    [-1.0, -1.0, -0.912, -0.306, -1.0],
])  # fmt: skip
"""(5, 5) figure 2 with lambda = 0, as it can be read off."""
RESOLUTION = 0.0015
"""Of that reading."""
PRINTED_OBJECTIVE, PRINTED_LAMBDA_0 = 12.6837, 1.05505
"""Of the conventions above; the paper prints 1.05 for the latter."""


@dataclass(frozen=True)
class Experiment1:
    """The 5 x 5 grid."""

    gamma: float = 0.9
    """Discount."""
    preference: tuple[int, ...] = (UP, RIGHT, DOWN, LEFT)
    """Order in which the expert's ties are broken."""
    l1: float = 1.05
    """lambda of the second panel."""

    @classmethod
    def quick(cls) -> "Experiment1":
        """The same: it takes a second."""
        return cls()

    def run(self, on_progress: Progress | None = None) -> "Outcome1":
        """Solve both programs, and those of other conventions."""
        report = on_progress or (lambda share: None)
        env = make(ENVIRONMENT)
        table = tabulate(env, gamma=self.gamma, check_steps=0)
        expert = value_iteration(table.mdp, table.reward, preference=self.preference).policy
        panels = [FiniteLP(margin_cap=None, l1=l1).fit(table.mdp, expert) for l1 in (0.0, self.l1)]
        report(0.2)
        return Outcome1(
            settings=self,
            env=env,
            table=table,
            expert=expert,
            free=panels[0],
            penalised=panels[1],
            lambda_0=FiniteLP(margin_cap=None).critical_l1(table.mdp, expert),
            alternatives=self._alternatives(table, report),
        )

    def _alternatives(self, table: Tabulation, report: Progress) -> dict[str, float]:
        """What other conventions give."""
        experts = list(_tie_breaks(table))
        lambdas, matches = [], 0
        for number, expert in enumerate(experts):
            lambdas.append(FiniteLP(margin_cap=None).critical_l1(table.mdp, expert))
            free = _grid(FiniteLP(margin_cap=None).fit(table.mdp, expert))
            matches += bool(np.abs(free - PRINTED).max() <= RESOLUTION)
            report(0.2 + 0.8 * (number + 1) / len(experts))
        noisy = tabulate(make(ENVIRONMENT, slip=0.4), gamma=self.gamma, check_steps=0)  # 0.7 and 3 x 0.1
        endless = _staying(table.mdp)
        paid_in_goal = endless.P @ table.mdp.terminal.astype(float)
        return {
            "ways to break the expert's ties": len(experts),
            "of these, such that give the printed panel": matches,
            "least lambda_0 of all ways": min(lambdas),
            "largest lambda_0 of all ways": max(lambdas),
            "lambda_0 if noise is never the chosen move": self._lambda_0(noisy.mdp, noisy.reward),
            "lambda_0 if the goal is paid at every step": self._lambda_0(endless, paid_in_goal.reshape(25, 4)),
        }

    def _lambda_0(self, mdp: TabularMDP, R: Reward) -> float:
        expert = value_iteration(mdp, R, preference=self.preference).policy
        return FiniteLP(margin_cap=None).critical_l1(mdp, expert)


def _tie_breaks(table: Tabulation) -> Iterator[np.ndarray]:
    """Every deterministic optimal policy (25,)."""
    best = optimal_actions(table.mdp, table.reward)
    best[table.mdp.terminal] = np.eye(4, dtype=bool)[UP]  # nothing is done there
    for actions in product(*(np.flatnonzero(row).tolist() for row in best)):
        yield np.array(actions)


def _staying(mdp: TabularMDP) -> TabularMDP:
    """The same table, whose terminal states are left for themselves for ever instead."""
    rows = np.flatnonzero(np.repeat(mdp.terminal, mdp.n_actions))
    loops = sp.csr_array((np.ones(rows.size), (rows, rows // mdp.n_actions)), shape=mdp.P.shape)
    return TabularMDP(mdp.P + loops, mdp.gamma, mdp.d0)


def _grid(result: Outcome) -> np.ndarray:
    """(5, 5) rewards of states."""
    reward: Any = result.reward
    return reward.values.reshape(5, 5)


@dataclass(frozen=True, eq=False)
class Outcome1:
    """What experiment 1 gave."""

    settings: Experiment1
    """What was asked."""
    env: gym.Env
    """The grid."""
    table: Tabulation
    """Its table."""
    expert: np.ndarray
    """(25,) actions."""
    free: Outcome
    """lambda = 0."""
    penalised: Outcome
    """lambda = `l1`."""
    lambda_0: float
    """The price above which R = 0."""
    alternatives: dict[str, float]
    """lambda_0 under other conventions."""

    @property
    def true(self) -> np.ndarray:
        """(5, 5) figure 1: 1 in the goal."""
        R = np.zeros((5, 5))
        R.flat[np.flatnonzero(self.table.mdp.terminal)] = 1.0
        return R

    @property
    def panels(self) -> tuple[np.ndarray, np.ndarray]:
        """(5, 5) rewards of figure 2: lambda = 0 and lambda = `l1`."""
        return _grid(self.free), _grid(self.penalised)

    @property
    def checks(self) -> tuple[Check, ...]:
        """Against the paper."""
        free, penalised = self.panels
        away = penalised[self.true == 0]
        gap = max(one.proof.duality_gap for one in (self.free, self.penalised))
        rewards = self.free.reward, self.penalised.reward
        violation = max(certify(self.table.mdp, self.expert, one).worst_violation for one in rewards)
        return (
            at_most("lambda = 0: farthest from the printed panel", 0.0, np.abs(free - PRINTED).max(), RESOLUTION),
            near("lambda = 0: objective (target, not printed)", PRINTED_OBJECTIVE, self.free.proof.objective, 5e-5),
            near("lambda_0 (target; printed: 1.05, just below)", PRINTED_LAMBDA_0, self.lambda_0, 5e-6),
            near(f"lambda = {self.settings.l1}: reward of the goal", 1.0, penalised[self.true == 1][0], 1e-6),
            reported(f"lambda = {self.settings.l1}: largest |R| elsewhere", "near 0", np.abs(away).max()),
            at_most("both: largest violation of (4)", 0.0, violation, 1e-6),
            at_most("both: objective short of the optimum", 0.0, gap, 1e-6),
            *(reported(what, "not said", value) for what, value in self.alternatives.items()),
        )

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        free, penalised = self.panels
        return {
            "settings": {one.name: getattr(self.settings, one.name) for one in fields(self.settings)},
            "expert": self.expert.reshape(5, 5).tolist(),
            "reward_lambda_0": free.tolist(),
            "reward_penalised": penalised.tolist(),
            "objectives": [self.free.proof.objective, self.penalised.proof.objective],
            "lambda_0": self.lambda_0,
            "checks": [one.to_json() for one in self.checks],
        }
