"""What one run of the loop does: a frozen record, and its json."""

import hashlib
import json
import math
import pickle
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from typing import Any, Literal

import numpy as np

from irl_gym.agents.noise import checked_epsilon
from irl_gym.agents.planners import Planner
from irl_gym.checks import checked_number, is_word
from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.demonstrations.endings import checked_after_end
from irl_gym.errors import InvalidParameter, MissingPart
from irl_gym.features.feature_maps import FeatureMap
from irl_gym.learners.base import Learner, checked_learner
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.needs import OR, PARTS
from irl_gym.mdp.rewards import plain_json
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.records import Record
from irl_gym.runs.choices import KNOWN, Reveals
from irl_gym.tables.tabulate import By


@dataclass(frozen=True)
class Experiment(Record):
    """What one run of the loop does.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        InvalidParameter: fewer than 1 episodes or copies; neither environment nor dataset, or an expert beside a dataset; two
            ways to make a table; noise outside 0 to 1; a warm start of what is no PPO or A2C.
        MissingPart: the learner needs what this run cannot give it, such as the policy of an expert that is known by episodes.
    """

    env_id: str | None
    """A registered environment; `module:id` for one of another package; None for the one that the dataset was recorded in."""
    gamma: float
    """Discount, between 0 and 1."""
    env_kwargs: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Given to `gymnasium.make`."""
    start_seeds: Sequence[int] = ()
    """Seeds of the layouts that resets draw from (MiniGrid); none for whatever resets draw."""
    reveal: Reveals = KNOWN
    """Hidden integers that the observation shall show, with their numbers of values; "known": those known to be hidden."""
    table: By | None = None
    """How a table is made; None for what is known of the environment, and enumeration where nothing is."""
    bins: int | Sequence[int] | None = None
    """Cells a coordinate, to make a table of an environment with continuous states; None for none."""
    samples: int = 0
    """Points drawn in each cell, whose steps are counted; 0 for the step from its centre, shared between its neighbours."""
    dataset: str | None = None
    """A Minari dataset of the expert's episodes, in place of an expert."""
    dataset_root: str | None = None
    """Minari's root folder; None for the one in force."""
    trust_dataset: bool = False
    """Import and call whatever the dataset says it was recorded in; else that has to be registered here."""
    after_end: AfterEnd = "refuse"
    """What to do with an episode of the dataset that goes on after its end: "refuse" it, or "cut" it there."""
    expert: Planner | None = None
    """Plans or learns under the true reward; None for ValueIteration where there is a table, else SB3."""
    epsilon: float = 0.0
    """Probability of a random action in place of the expert's; above 0 a learner sees only what the episodes show."""
    episodes: int = 500
    """Demonstrations recorded."""
    learner: Learner = field(default_factory=lambda: FiniteLP(report_lambda_0=True))
    """Recovers the reward, or learns a policy: FiniteLP, FeatureLP, TrajectoryLP, or one of your own."""
    features: FeatureMap | None = None
    """phi of observations, for a learner that has none of its own."""
    inner: Planner | None = None
    """Solves for each reward that TrajectoryLP tries; None for ValueIteration where there is a table, else SB3."""
    shaping: bool = True
    """Retrain on the expected advantage under the learned reward, clipped; else on the reward as it is. It needs a table."""
    retrain: Planner | None = None
    """Plans or learns under the learned reward; None for SB3 with settings that suit that reward."""
    warm_start: Literal["clone"] | None = None
    """What training begins with: None for random weights; "clone" for a network that is cloned from the demonstrations."""
    num_envs: int | None = None
    """Copies of the environment that SB3 trains on; None for 64 of a table, 8 of a world that is stepped."""
    eval_episodes: int = 200
    """Episodes for the mean returns."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        check_discount(self.gamma)
        for name in ("env_id", "dataset"):
            if not isinstance(getattr(self, name), str | None):
                raise InvalidParameter(f"{name} is {getattr(self, name)!r:.80}: expected a text, or None.")
        if (self.env_id or self.dataset) is None:
            raise InvalidParameter(
                "env_id and dataset are None: expected an environment, or a dataset that was recorded in one."
            )
        if self.dataset is not None and self.env_id is None and (self.start_seeds or self.reveal not in ({}, KNOWN)):
            raise InvalidParameter(
                f"start_seeds is {self.start_seeds!r} and reveal {self.reveal!r}, but the environment is the dataset's: "
                "expected neither. Name env_id, or leave them out."
            )
        checked_learner(self.learner)
        checked_epsilon(self.epsilon)
        checked_after_end(self.after_end)
        if self.dataset is not None and (self.expert is not None or self.epsilon):
            raise InvalidParameter(
                f"dataset is {self.dataset!r}, but expert is {self.expert} and epsilon {self.epsilon}: expected the episodes "
                "as they are. Leave expert and epsilon out."
            )
        if self.table is not None and (self.bins is not None or not isinstance(self.table, By)):
            raise InvalidParameter(
                f"table is {self.table!r} and bins {self.bins}: expected Enumeration(...) or Interaction(...) for discrete "
                "states, or bins for continuous ones. Leave one out."
            )
        _check_start(self.warm_start, self.retrain)
        checked_number("samples", self.samples, "a whole number of at least 0", least=0, whole=True)
        for name in ("episodes", "num_envs", "eval_episodes"):
            if name != "num_envs" or self.num_envs is not None:
                checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)
        expected = "a whole number from 0 to 2^32 - 1, as Stable-Baselines3 takes"
        checked_number("seed", self.seed, expected, least=0, below=2**32, whole=True)
        for name in ("episodes", "num_envs", "eval_episodes", "samples", "seed"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, int(getattr(self, name)))  # NumPy's integers seed neither Gymnasium nor SB3
        _check_needs(self.learner, self.env_id, self.dataset, self.epsilon, self.features)

    @property
    def from_episodes(self) -> bool:
        """Does a learner of tables see only what the episodes show, not the expert's whole policy?"""
        return self.dataset is not None or self.epsilon > 0

    @property
    def name(self) -> str:
        """A folder's name that no other experiment has: the environment and a digest of everything."""
        return f"{re.sub(r'[^-A-Za-z0-9]+', '-', self.env_id or self.dataset or '')}-{digest_of(self.to_json())}"

    def to_json(self) -> dict[str, Any]:
        """The configuration as json; planners, learners and features with their class's name, large arrays by their digest.

        Fields that came later are left out at their default: so a run of an earlier version is known again.
        """
        told = {name: as_config(getattr(self, name)) for name in self.__dataclass_fields__}
        return {name: value for name, value in told.items() if name not in LATER or value != LATER[name]}


def _check_needs(learner: Any, env_id: str | None, dataset: str | None, epsilon: float, features: Any) -> None:
    """Check, before anything is worked out, that a run can give a learner what it needs of all but the world.

    Raises:
        MissingPart: it cannot.
    """
    own = "Call its `learn` with a Problem of your own."
    lacks = {"also": ("a run is of one world", own)}
    if dataset is None:
        lacks["horizon"] = "a run knows one only of a dataset's episodes", own
    if features is None:
        told = "Give features, such as OneHot(16). (On the command line every run gives them to a learner that needs them.)"
        lacks["features"] = "no features are given", told
    if dataset is not None or epsilon:
        env = "the environment's id" if env_id is None else env_id
        told = f"Leave dataset out, and give env_id. (On the command line: --env-id {env} without --dataset or --csv.)"
        if dataset is None:
            told = "Leave epsilon out. (On the command line: the same without --epsilon.)"
        unknown = ("expert",) if dataset is None else ("expert", "oracle")  # one that errs can still be asked
        lacks |= dict.fromkeys(unknown, ("the expert is known by its episodes only", told))
    part = learner.needs.lacking({*PARTS} - {*lacks})
    if part is not None:
        why, mend = lacks[part.split(OR)[0]]
        raise MissingPart(f"{type(learner).__name__} needs {part}, and {why}: expected a run that has it. {mend}")


def _check_start(warm_start: Any, retrain: Any) -> None:
    """Check that what is retrained can begin with a clone: a policy, of SB3.

    Raises:
        InvalidParameter: it cannot, or is no way to begin.
    """
    if warm_start is not None and not is_word(warm_start, "clone"):
        raise InvalidParameter(f"warm_start is {warm_start!r:.80}: expected 'clone', or None.")
    if warm_start is not None and retrain is not None and getattr(retrain, "algorithm", None) not in ("PPO", "A2C"):
        raise InvalidParameter(
            f"warm_start is 'clone', but retrain is {retrain!r:.80}: expected PPO or A2C, whose networks are policies. Leave "
            "warm_start out."
        )


LATER = {"after_end": "refuse", "trust_dataset": False, "features": None, "warm_start": None}
"""Fields that earlier versions had not, and what these did."""
MOST_LISTED = 64
"""Numbers of an array that a configuration lists."""
SAY_ALL = frozenset({"builtins", "datetime", "decimal", "fractions", "pathlib", "uuid"})
"""Modules whose objects may be told by their text."""


def digest_of(config: Mapping[str, Any]) -> str:
    """8 hexadecimal digits that tell one configuration from another."""
    return hashlib.sha256(json.dumps(config, sort_keys=True).encode()).hexdigest()[:8]


def class_name(value: Any) -> str:
    """The name of an object's class; of one that is not of this library with its module, since two may have one name."""
    kind = type(value)
    return kind.__name__ if kind.__module__.partition(".")[0] == "irl_gym" else f"{kind.__module__}:{kind.__qualname__}"


def as_config(value: Any) -> Any:
    """What json holds of a part of an experiment: of a large array, or an object without a text of its own, a digest."""
    if is_dataclass(value) and not isinstance(value, type):
        return {
            "type": class_name(value),
            **{one.name: as_config(getattr(value, one.name)) for one in fields(value) if one.init},
        }
    if isinstance(value, Mapping):
        return {str(key): as_config(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_config(one) for one in value]
    if isinstance(value, set | frozenset):
        return [as_config(one) for one in sorted(value, key=repr)]
    if isinstance(value, np.ndarray):
        if value.size <= MOST_LISTED:
            return as_config(value.tolist())
        content = None if value.dtype.hasobject else np.ascontiguousarray(value).tobytes()
        return {"array": list(value.shape), "sha256": _digest(value.tolist()) if content is None else _sha256(content)}
    if hasattr(value, "__qualname__"):  # a function, or a class
        return value.__qualname__
    kind = type(value)
    if not isinstance(value, str | int | float | Enum | None) and not hasattr(value, "tolist") and not _says_all(value):
        return {"object": f"{kind.__module__}.{kind.__qualname__}", "sha256": _digest(value)}
    plain = json.loads(json.dumps(value, default=plain_json))
    return {"float": str(plain)} if isinstance(plain, float) and not math.isfinite(plain) else plain


def _says_all(value: Any) -> bool:
    """Does an object's text hold all of it? Not that of a table, which is shortened, or of who says where it is in memory."""
    return type(value).__module__.partition(".")[0] in SAY_ALL and " at 0x" not in str(value)


def _digest(value: Any) -> str | None:
    """Of an object's pickle; None where it refuses to be pickled."""
    try:
        return _sha256(pickle.dumps(value, protocol=4))
    except Exception:  # whatever its class raises
        return None


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
