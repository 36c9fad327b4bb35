"""Learners as a user writes them, outside the library: one of rewards, and one of policies."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from irl_gym.agents.experts import Acting
from irl_gym.demonstrations.demonstrated import smoothed
from irl_gym.facts import Fact
from irl_gym.learners.base import Outcome
from irl_gym.learners.needs import PARTS, Needs
from irl_gym.mdp.rewards import TabularReward
from irl_gym.programs.status import Status


@dataclass(frozen=True)
class Told:
    """A proof of nothing but what was done, with entries that the library calls by the same names and means otherwise."""

    sides: int
    objective: float = 0.0
    duality_gap: float = float("inf")

    def facts(self):
        return (Fact("dice", f"thrown with {self.sides} sides"),)

    def to_json(self):
        clash = {"states": "all", "margin_cap": "none", "gaps": ["wide"], "facts": 7, "learner": [], "degenerate": "a little"}
        return {"sides": self.sides, **clash}


@dataclass(frozen=True)
class Dice:
    """A reward by chance."""

    sides: int = 6
    needs: ClassVar[Needs] = Needs(("dynamics",))

    def learn(self, problem, rng):
        known = self.needs.of(problem, self)
        thrown = rng.integers(self.sides, size=known.dynamics.n_states) / self.sides
        return Outcome(TabularReward(thrown), Status.LEARNED, Told(self.sides))


@dataclass(frozen=True)
class Copycat:
    """The shares of the actions in the episodes, with one more of each; any action where nothing was seen."""

    needs: ClassVar[Needs] = Needs(("demonstrations",))
    how: ClassVar[str] = "copied from the episodes"

    def learn(self, problem, rng):
        known = self.needs.of(problem, self)
        actions = int(known.spaces.actions.n)
        return Outcome(None, Status.LEARNED, Told(0), policy=np.nan_to_num(smoothed(known.seen), nan=1 / actions))


@dataclass(frozen=True)
class Both(Copycat):
    """The same policy, and a reward of what was seen."""

    def learn(self, problem, rng):
        policy = super().learn(problem, rng).policy
        seen = problem.spaces.states
        visits = np.zeros(seen.n_states)
        for episode in problem.demonstrations:
            np.add.at(visits, episode.rows(seen)[1:], 1.0)
        return Outcome(TabularReward(visits / visits.max()), Status.LEARNED, Told(0), policy=policy)


def parts_of(problem):
    """The names of what is there of a problem."""
    return [one for one in PARTS if (found := getattr(problem, one)) is not None and not (one == "also" and not found)]


@dataclass(frozen=True)
class Needy:
    """Needs one part of a problem, and keeps what it is given, as it is."""

    part: str
    given: ClassVar[list] = []

    @property
    def needs(self):
        return Needs((self.part,))

    def learn(self, problem, rng):
        self.given.append(problem)
        self.needs.of(problem, self)
        return Outcome(TabularReward(np.zeros(problem.spaces.observations.n)), Status.LEARNED, Told(0))


@dataclass(frozen=True)
class Pusher:
    """Pushes a cart to where its pole falls: a function of observations, which no file keeps."""

    weight: float = 1.0
    needs: ClassVar[Needs] = Needs(("demonstrations",))

    def learn(self, problem, rng):
        known = self.needs.of(problem, self)
        push = Acting(lambda seen: int(seen[2] + self.weight * seen[3] > 0), 2, known.spaces.observations)
        return Outcome(None, Status.LEARNED, Told(0), policy=push)


@dataclass(frozen=True)
class Careless:
    """A reward, with notes and a proof that no file can hold."""

    what: str
    needs: ClassVar[Needs] = Needs(("dynamics",))

    def learn(self, problem, rng):
        reward = TabularReward(np.zeros(problem.dynamics.n_states))
        stats = {"spread": np.zeros(3)} if self.what == "stats" else {}
        return Outcome(reward, Status.LEARNED, Wordy() if self.what == "facts" else Told(1), stats)


class Wordy(Told):
    """A proof with a label that nobody reads."""

    def __init__(self):
        super().__init__(1)

    def facts(self):
        return (Fact("x" * 81, "too long"),)
