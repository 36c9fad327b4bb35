"""Rewards made by hand, as if a learner had given them, and worlds in which they go wrong."""

import numpy as np
from models import ring

from irl_gym.features.feature_maps import Table
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.diagnoses.doctor import doctor
from irl_gym.judging.diagnoses.findings import WHERE
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs.proofs.finite_proof import prove
from irl_gym.learners.linear_programs.proofs.trajectory_proof import TrajectoryProof
from irl_gym.mdp.margins import comparable
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.policies import completed
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.solvers import Status


def judged(mdp, expert, R, stats=None):
    """A result with this reward."""
    reward = TabularReward(np.asarray(R, dtype=float))
    compared = compare(mdp, completed(expert, mdp.n_states)[0])
    proof = prove(mdp, compared, reward, comparable(compared, reward), r_max=1.0)
    return Outcome(reward, Status.OPTIMAL, proof, stats or {})


def names(result, mdp, expert, **known):
    """The names of the doctor's findings."""
    return doctor(result, mdp, expert, **known).names


def finding(name, result, mdp, expert, **known):
    """The finding of this name."""
    found = next(one for one in doctor(result, mdp, expert, **known).findings if one.name == name)
    assert (WHERE in found.sentence) <= bool(found.states.size)
    return found


def check_mends(name, says, ill, mended):
    """The finding of this name says this mend in one diagnosis, and is in none of those of what was done about it."""
    assert says in next((one.mend for one in ill().findings if one.name == name), "")
    assert [number for number, each in enumerate(mended) if name in each().names] == []


def corridor(length, gamma):
    """Cells in a row from 0, left (0) and right (1); the last cell is terminal."""
    P = np.zeros((length, 2, length))
    for s in range(length - 1):
        P[s, 0, max(s - 1, 0)] = P[s, 1, s + 1] = 1
    return TabularMDP.from_dense(P, gamma, np.eye(length)[0])


def right(mdp):
    """The expert of a corridor."""
    return np.ones(mdp.n_states, dtype=int)


def contradicted():
    """States 0 and 3 choose between 1 and 2, and action 0 chooses differently: only V(1) = V(2) makes it optimal."""
    return ring([[1, 2], [3, 3], [0, 0], [2, 1]])


def partly_contradicted():
    """The same with a state 4, in which action 0 can be preferred."""
    return ring([[1, 2], [3, 3], [0, 0], [2, 1], [1, 4]])


def sampled(**changes):
    """A result of TrajectoryLP in which nothing is wrong, but for the changes."""
    stats = changes.pop("stats", {})
    healthy = {
        "gaps": np.array([3.0, 1.0]), "gap_errors": np.array([0.1, 0.1]), "regret": -0.05, "regret_error": 0.1,
        "distance": 0.2, "distance_error": 0.3, "objective": 4.0, "dual_bound": 4.0, "penalty": 2.0, "gap_cap": None, "l1": 0.0,
        "alpha_l1_norm": 2.0, "rank": 2, "n_features": 2, "horizon": 500, "truncation": 0.01, "zero": False,
        "round": 2, "rounds": 2,
    }  # fmt: skip
    proof = TrajectoryProof(**{**healthy, **changes})
    return Outcome(LinearReward(np.array([1.0, -0.5]), Table(np.eye(2))), Status.OPTIMAL, proof, stats)
