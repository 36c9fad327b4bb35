"""Transforms of a reward that keep the set of optimal policies (Ng, Harada & Russell 1999), as named objects.

Each is a frozen record with `apply(reward, mdp) -> TabularReward`. An LP's margins are small against the range of its values,
and an agent that learns from samples sees the values first; these make the same policies easier to learn.
Axes: S states, A actions.
"""

import os
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from irl_gym._typing import Vector
from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter, InvalidReward
from irl_gym.mdp.planning.dynamic_programming import backup, optimum
from irl_gym.mdp.rewards import TabularReward, read_archive, write_archive
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.records import Record


@runtime_checkable
class Transform(Protocol):
    """A change of a reward that leaves the set of optimal policies as it is."""

    def apply(self, reward: TabularReward, mdp: TabularMDP) -> TabularReward:
        """The transformed reward, (S,) or (S, A)."""
        ...


@dataclass(frozen=True)
class Unchanged:
    """The reward as it is."""

    def apply(self, reward: TabularReward, mdp: TabularMDP) -> TabularReward:
        """Return the reward itself."""
        return reward


@dataclass(frozen=True)
class PositiveScaling:
    """R' = factor R. Every value is multiplied by the factor, so no comparison changes.

    Raises:
        InvalidParameter: a factor that is not positive and finite.
    """

    factor: float
    """Above 0."""

    def __post_init__(self) -> None:
        checked_number("factor", self.factor, "a finite number above 0", above=0)

    def apply(self, reward: TabularReward, mdp: TabularMDP) -> TabularReward:
        """The scaled reward, of the same shape."""
        return TabularReward(
            self.factor * reward.values, {**reward.note, "scaled_by": self.factor}, self.factor * reward.tolerance
        )


@dataclass(frozen=True, eq=False)
class PotentialShaping(Record):
    """R'(s, a) = E R + gamma E Phi(s') - Phi(s), with Phi = 0 at terminal states (Ng, Harada & Russell 1999, theorem 1).

    Every Q(s, a) falls by Phi(s), whatever the action. At a terminal state a potential would be paid and never taken back,
    which changes the optimal policies: it has to be 0.

    Raises:
        InvalidParameter: wrong shape, not finite, or not 0 at a terminal state (when applied).
    """

    potential: Vector
    """(S,) Phi."""

    def apply(self, reward: TabularReward, mdp: TabularMDP) -> TabularReward:
        """The shaped reward (S, A)."""
        phi = np.asarray(self.potential, dtype=np.float64)
        if phi.shape != (mdp.n_states,) or not np.isfinite(phi).all():
            raise InvalidParameter(f"the potential has shape {phi.shape}: expected ({mdp.n_states},) finite numbers.")
        wrong = np.flatnonzero(mdp.terminal & (phi != 0))
        if wrong.size:
            raise InvalidParameter(
                f"the potential of terminal state {wrong[0]} is {phi[wrong[0]]}: expected 0, or the optimal policies change."
            )
        shaped = backup(mdp, reward.expected(mdp), phi) - phi[:, None]
        return TabularReward(
            np.where(mdp.terminal[:, None], 0.0, shaped), {**reward.note, "shaped": "potential"}, reward.tolerance
        )


@dataclass(frozen=True)
class ExpectedAdvantage(Record):
    """R'(s, a) = A(s, a) = Q(s, a) - V(s) <= 0, optimal under the reward; potential shaping with Phi = V.

    What an agent pays is then what its action loses, at once: the optimal actions, 0, are greedy whatever the discount.
    With `clip` = tau every loss counts up to tau, in units of tau: R' = max(A, -tau) / tau, between -1 and 0. Optimal actions
    still pay 0 and all others less, so the optimal policies stay (a sum of non-positive payments is 0 only if all are).
    A loss within the rounding of the table's own numbers is no loss: ties stay ties.

    Raises:
        InvalidParameter: a clip that is not positive.
    """

    clip: float | None = None
    """tau > 0, in units of the reward's values; None for the advantage itself."""

    def __post_init__(self) -> None:
        if self.clip is not None:
            checked_number("clip", self.clip, "a finite number above 0, or None", above=0)

    def apply(self, reward: TabularReward, mdp: TabularMDP) -> TabularReward:
        """The advantage (S, A)."""
        found = optimum(mdp, reward)
        gains = found.advantages.values.astype(np.float64)
        advantage = np.where(found.tied() | mdp.terminal[:, None], 0.0, gains - gains.max(axis=1, keepdims=True))
        unit = 1.0
        if self.clip is not None:
            advantage, unit = np.maximum(advantage, -self.clip) / self.clip, self.clip
        return TabularReward(advantage, {**reward.note, "shaped": "expected advantage"}, reward.tolerance / unit)


def typical_loss(reward: TabularReward, mdp: TabularMDP) -> float | None:
    """A clip for ExpectedAdvantage where no margin cap is known: the median, over reachable states, of the smallest loss.

    The smallest loss of a state is what its best action that is not optimal loses; None where no action loses anything. Any
    clip keeps the optimal policies; one of this size lets an agent that learns from samples see half of the losses whole.
    """
    loss = -ExpectedAdvantage().apply(reward, mdp).values[mdp.reachable & ~mdp.terminal]
    least = np.where(loss > 0, loss, np.inf).min(axis=1)
    least = least[np.isfinite(least)]
    return float(np.median(least)) if least.size else None


@dataclass(frozen=True, eq=False)
class ShapedReward(Record):
    """A learned reward with what an agent is paid in its place: its expected advantage, where losses count up to a clip.

    The same policies are optimal, and what an action loses is paid at once: values of the learned reward are large against
    its margins, which is what agents that learn from steps see last. A return is that of the shaping, not of the reward.

    Raises:
        InvalidReward: what is paid is not (S, A), or the reward is of another number of states or actions.
        InvalidParameter: a clip that is not positive.
    """

    FORMATS: ClassVar[tuple[str, ...]] = ("irl_gym.ShapedReward/1",)

    paid: TabularReward
    """(S, A) between -1 and 0 in units of the clip; 0 for the optimal actions."""
    learned: TabularReward
    """(S,) or (S, A) the reward itself."""
    clip: float | None = None
    """Losses above it count as it; None where no action loses anything, and what is paid is not clipped."""

    def __post_init__(self) -> None:
        shape, known = self.paid.values.shape, self.learned.values.shape
        if len(shape) != 2 or shape[: len(known)] != known:
            raise InvalidReward(f"what is paid has shape {shape}, for a reward {known}: expected (S, A) of the same states.")
        ExpectedAdvantage(self.clip)  # checks it

    def __reduce__(self) -> tuple:
        return type(self), (self.paid, self.learned, self.clip)

    def __repr__(self) -> str:
        return f"ShapedReward(the expected advantage of {self.learned!r}, losses up to {self.clip})"

    @classmethod
    def of(cls, reward: TabularReward, mdp: TabularMDP, clip: float | None = None) -> "ShapedReward":
        """Shape a reward.

        Args:
            reward: (S,) or (S, A).
            mdp: the table that it is of.
            clip: tau, such as the margin cap of FiniteLP's proof; None for a typical loss.

        Raises:
            InvalidReward: a reward of another number of states or actions.
            InvalidParameter: a clip that is not positive.
        """
        clip = typical_loss(reward, mdp) if clip is None else clip
        return cls(ExpectedAdvantage(clip).apply(reward, mdp), reward, clip)

    @property
    def values(self) -> np.ndarray:
        """(S, A) what is paid."""
        return self.paid.values

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return self.paid.n_states

    def pay(self, states: Any, actions: Any, next_states: Any) -> Any:
        """What is paid for steps (s, a, s'): scalars or arrays (N,) in, the same shape out."""
        return self.paid.pay(states, actions, next_states)

    def save(self, path: str | os.PathLike) -> None:
        """Write an npz without pickle. Beside first, then renamed."""
        header = {"format": self.FORMATS[0], "note": self.learned.note, "tolerance": self.learned.tolerance, "clip": self.clip}
        write_archive(path, header, {"values": self.paid.values, "learned": self.learned.values})

    @classmethod
    def load(cls, path: str | os.PathLike) -> "ShapedReward":
        """Read what `save` wrote. Nothing is unpickled.

        Raises:
            FileNotFoundError: no such file.
            InvalidReward: the file holds no such reward.
        """
        header, arrays = read_archive(path, cls.FORMATS)
        try:
            learned = TabularReward(arrays["learned"], header["note"], header["tolerance"])
            clip = header["clip"]
            within = learned.tolerance / (1.0 if clip is None else ExpectedAdvantage(clip).clip or 1.0)
            return cls(TabularReward(arrays["values"], {**learned.note, "shaped": "expected advantage"}, within), learned, clip)
        except (KeyError, InvalidReward, InvalidParameter) as error:
            raise InvalidReward(f"{path} holds no reward ({error}): expected a file written by ShapedReward.save.") from error
