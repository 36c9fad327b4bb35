"""Every error that irl_gym raises on purpose.

IrlGymError
├── InvalidInput (also a ValueError)
│   ├── InvalidMDP             a table that is not a finite MDP
│   ├── InvalidDiscount        gamma outside (0, 1)
│   ├── InvalidPolicy          wrong shape, action out of range, rows that do not sum to 1
│   ├── InvalidReward          wrong shape, NaN, a file that holds no reward
│   ├── InvalidFeatures        features with NaN, of the wrong length, or of other observations
│   ├── InvalidParameter       a hyper-parameter outside its range
│   ├── DamagedFile            a file that was cut off or changed, or that declares more than it can hold
│   ├── MissingPart            a learner needs a part of a problem that is not there
│   ├── UnknownObservation     an observation that the state index does not hold
│   └── InvalidDemonstrations  episodes that no environment could have produced
├── UnknownEnvironment         an id that is not registered; the closest names are offered
├── UnknownLearner             a learner that is neither built in nor found where its name says
├── NotTrusted                 what a file names, and would have been imported and called
├── NotDiscrete                a space with infinitely many elements where finitely many are needed
├── NotTabular                 an environment that publishes no table, or whose table is not the whole truth
│   ├── HiddenState            one observation that behaves in two ways: it hides part of the state
│   ├── NotCopied              an environment that cannot be copied, so that nothing can be tried in it
│   ├── EnvironmentFailed      an environment that raised an error of its own
│   └── EnumerationLimit       more states, seconds or bytes than an enumeration was allowed
├── NotEnumerable              a call with random outcomes that cannot be listed one by one
├── NotSettable                an environment that cannot be set to a given state
├── TableMismatch              `env.step` did what the table says is impossible
├── UndefinedDistance          a reward that is constant, so that its distance from another is not defined
├── DegenerateExpert           equation (4) of Ng & Russell leaves no reward that prefers the expert's actions
├── SolverError
│   ├── SolverTimeout          the time limit was reached before an answer
│   └── SolverFailed           no solver gave an answer
│       └── SolverInfeasible   the answer is that the constraints contradict each other
├── DatasetMismatch            a dataset recorded in another environment
├── DatasetExists              a Minari id that is taken
├── DatasetMissing (also a FileNotFoundError)  a Minari id that is not there
├── NotInstalled (also an ImportError)  an optional package that is asked for and missing
├── RunConflict                a run folder that holds another run, or that another process works in
├── WriteFailed (also an OSError)  the disk became full, or the folder was deleted, while something was written
└── UnreadableRun
    ├── RunIncomplete          a run that was killed before its end, or lost a file
    └── RunNewer               a run that a newer version wrote

A message reads `what, with the value: what was expected. The mend.`
"""

import re
from collections.abc import Collection
from difflib import get_close_matches
from typing import Any


class IrlGymError(Exception):
    """Base class: `except IrlGymError` catches everything this library raises on purpose."""


class InvalidInput(IrlGymError, ValueError):
    """An argument that cannot be right."""


class InvalidMDP(InvalidInput):
    """A transition table that is not a finite MDP."""


class InvalidDiscount(InvalidInput):
    """A discount outside the open interval (0, 1)."""


class InvalidPolicy(InvalidInput):
    """A policy of the wrong shape, with actions out of range or probabilities that do not sum to 1."""


class InvalidReward(InvalidInput):
    """A reward of the wrong shape, with NaN, or a file that holds no reward."""


class InvalidFeatures(InvalidInput):
    """Features with NaN, of the wrong length, or of other observations than they are given."""


class InvalidParameter(InvalidInput):
    """A hyper-parameter outside its range."""


class DamagedFile(InvalidInput):
    """A file that was cut off or changed, that leads elsewhere, or that declares more than it can hold."""


class MissingPart(InvalidInput):
    """A learner needs a part of a problem that is not there."""


class UnknownObservation(InvalidInput):
    """An observation that the state index does not hold."""


class InvalidDemonstrations(InvalidInput):
    """Episodes that no environment could have produced."""


class UnknownEnvironment(IrlGymError):
    """An environment id that is not registered."""


class UnknownLearner(IrlGymError):
    """A learner that is neither built in nor found where its name says."""


class NotTrusted(IrlGymError):
    """What a file names, which is not imported and called on its word."""


class NotDiscrete(IrlGymError):
    """A space with infinitely many elements where finitely many are needed."""


class NotTabular(IrlGymError):
    """An environment that publishes no table, or whose table is not the whole truth."""


class NotEnumerable(IrlGymError):
    """A call with random outcomes that cannot be listed one by one."""


class HiddenState(NotTabular):
    """One observation that behaves in two ways: it hides part of the state."""


class NotCopied(NotTabular):
    """An environment that cannot be copied, so that nothing can be tried in it."""


class EnvironmentFailed(NotTabular):
    """An environment that raised an error of its own."""


class EnumerationLimit(NotTabular):
    """More states, seconds or bytes than an enumeration was allowed."""


class NotSettable(IrlGymError):
    """An environment that cannot be set to a given state."""


class TableMismatch(IrlGymError):
    """`env.step` did what the table says is impossible."""


class UndefinedDistance(IrlGymError):
    """A reward that is constant where rewards are compared, so that its distance from another is not defined."""


class DegenerateExpert(IrlGymError):
    """No reward prefers the expert's actions: equation (4) holds only with every margin zero."""


class SolverError(IrlGymError):
    """A linear program without an answer."""


class SolverTimeout(SolverError):
    """The time limit was reached before an answer."""


class SolverFailed(SolverError):
    """No solver gave an answer."""


class SolverInfeasible(SolverFailed):
    """The answer is that the constraints contradict each other."""


class DatasetMismatch(IrlGymError):
    """A dataset that was recorded in another environment."""


class DatasetExists(IrlGymError):
    """A Minari dataset id that is taken."""


class DatasetMissing(IrlGymError, FileNotFoundError):
    """A Minari dataset id that is not there."""


class NotInstalled(IrlGymError, ImportError):
    """An optional package that is asked for and missing."""


class RunConflict(IrlGymError):
    """A run folder that holds another run, or in which another process works."""


class WriteFailed(IrlGymError, OSError):
    """The disk became full, or the folder was deleted, while something was written into it."""


class UnreadableRun(IrlGymError):
    """A run folder that cannot be read."""


class RunIncomplete(UnreadableRun):
    """A run folder without a file that a run leaves, or of a run that was killed before its end."""


class RunNewer(UnreadableRun):
    """A run folder that a newer version wrote."""


def did_you_mean(name: str, known: Collection[str]) -> str:
    """What an error ends with that a mistyped name caused: the closest one as a question; nothing where none is close."""
    close = get_close_matches(name, known, 1, 0.5)
    return f" Did you mean {close[0]!r}?" if close else ""


SPOKEN_AS_VOWEL = re.compile(r"(?!U[A-Z]|[Oo]ne|[Uu](?:int|ni(?!n|m)|se))[AEIOUaeiou]|[FHLMNRSX][A-Z0-9]|nd|rng")
"""How a name begins that is spoken as a vowel: ndarray, MDPView and Episode, but not uint8, Unicode, URL and OneHot."""


def with_article(name: str) -> str:
    """A name of a type with its article, as it is spoken: a list, an int, an ndarray."""
    return f"{'an' if SPOKEN_AS_VOWEL.match(name) else 'a'} {name}"


def a_type(value: Any) -> str:
    """What a value is, in words that follow "is": an int, a list, None."""
    return "None" if value is None else with_article(type(value).__name__)
