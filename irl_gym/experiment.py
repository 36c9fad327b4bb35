"""What one run of the loop does: a frozen record, and its json."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from typing import Any

from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter
from irl_gym.learners.base import Learner
from irl_gym.learners.finite import FiniteLP
from irl_gym.mdp import check_discount
from irl_gym.planners import FOR_ADVANTAGES, SB3, Planner, ValueIteration
from irl_gym.rewards import plain_json


@dataclass(frozen=True)
class Experiment:
    """What one run of the loop does.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        InvalidParameter: fewer than 1 episodes or copies.
    """

    env_id: str
    """A registered environment; `module:id` for one of another package."""
    gamma: float
    """Discount, between 0 and 1."""
    env_kwargs: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Given to `gymnasium.make`."""
    expert: Planner = field(default_factory=ValueIteration)
    """Plans or learns under the true reward."""
    episodes: int = 500
    """Demonstrations recorded."""
    learner: Learner = field(default_factory=lambda: FiniteLP(report_lambda_0=True))
    """Recovers the reward."""
    shaping: bool = True
    """Retrain on the expected advantage under the learned reward, clipped at the margin cap; else on the reward as it is."""
    retrain: Planner = field(default_factory=lambda: SB3(hyperparameters=FOR_ADVANTAGES))
    """Plans or learns under the learned reward."""
    num_envs: int = 64
    """Copies of the environment that SB3 trains on."""
    eval_episodes: int = 200
    """Episodes for the mean returns."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        check_discount(self.gamma)
        for name in ("episodes", "num_envs", "eval_episodes"):
            checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)
        expected = "a whole number from 0 to 2^32 - 1, as Stable-Baselines3 takes"
        checked_number("seed", self.seed, expected, least=0, below=2**32, whole=True)
        for name in ("episodes", "num_envs", "eval_episodes", "seed"):
            object.__setattr__(self, name, int(getattr(self, name)))  # NumPy's integers seed neither Gymnasium nor SB3

    @property
    def name(self) -> str:
        """A folder's name that no other experiment has: the environment and a digest of everything."""
        digest = hashlib.sha256(json.dumps(self.to_json(), sort_keys=True).encode()).hexdigest()[:8]
        return f"{re.sub(r'[^-A-Za-z0-9]+', '-', self.env_id)}-{digest}"

    def to_json(self) -> dict[str, Any]:
        """The configuration as json; planners and learners with their class's name."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        for name, value in plain.items():
            if is_dataclass(value) and not isinstance(value, type):
                plain[name] = {"type": type(value).__name__, **asdict(value)}
        return json.loads(json.dumps(plain, default=plain_json))


def parse_keywords(parts: Sequence[str]) -> dict[str, Any]:
    """Arguments of an environment given as text: `name=value` pairs, each value json or plain text; or one json object.

    Raises:
        InvalidParameter: neither.
    """
    if len(parts) == 1 and parts[0].lstrip().startswith("{"):
        try:
            return json.loads(parts[0])
        except json.JSONDecodeError as error:
            raise InvalidParameter(f"env-kwargs is {parts[0]!r}, not json ({error}): expected an object.") from error
    found: dict[str, Any] = {}
    for part in parts:
        name, equals, text = part.partition("=")
        if not equals or not name.isidentifier():
            raise InvalidParameter(f"env-kwargs has {part!r}: expected name=value, such as map_name=8x8.")
        try:
            found[name] = json.loads(text)
        except json.JSONDecodeError:
            found[name] = text
    return found
