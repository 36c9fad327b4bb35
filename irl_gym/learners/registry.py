"""Learners by name: those that are built in, and a user's own as `module:Class`."""

import importlib
import inspect
from typing import Any

from irl_gym.checks import no_module
from irl_gym.errors import InvalidParameter, UnknownLearner, did_you_mean
from irl_gym.learners.needs import Needs

BUILT_IN = {
    "finite-lp": "irl_gym.learners.linear_programs.finite:FiniteLP",
    "feature-lp": "irl_gym.learners.linear_programs.feature:FeatureLP",
    "trajectory-lp": "irl_gym.learners.linear_programs.trajectory:TrajectoryLP",
    "clone": "irl_gym.learners.cloning.clone:Clone",
    "softmax-clone": "irl_gym.learners.cloning.softmax:SoftmaxClone",
    "neural-clone": "irl_gym.agents.neural_clone:NeuralClone",
    "dagger": "irl_gym.learners.interactive.dagger:DAgger",
}
"""Name on the command line -> where the class is. A new learner is one line here."""


def learner_class(name: str) -> type[Any]:
    """The class of a learner.

    Args:
        name: of one that is built in; or `module:Class` of any other, which is imported.

    Raises:
        UnknownLearner: no such name, module or class, or one that is no learner: `needs` and `learn` are missing.
    """
    where = BUILT_IN.get(name, name)
    module, colon, attribute = where.partition(":")
    if not colon:
        raise UnknownLearner(
            f"learner is {name!r}: expected one of {', '.join(BUILT_IN)}, or module:Class of your own."
            f"{did_you_mean(name, BUILT_IN)}"
        )
    if not all(part.isidentifier() for part in module.split(".")):
        raise UnknownLearner(f"learner is {name!r}: expected a module and a class, such as my_module:MyLearner.")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise  # of something that the user's module imports
        raise UnknownLearner(f"learner is {name!r}, and {no_module(error.name, attribute)}") from error
    except AttributeError as error:
        raise UnknownLearner(f"learner is {name!r}, and {module} has no {attribute!r}: expected a class of it.") from error
    usable = isinstance(getattr(found, "needs", None), Needs) and callable(getattr(found, "learn", None))
    if not inspect.isclass(found) or not usable:
        raise UnknownLearner(
            f"learner is {name!r}, {found!r:.80}: expected a class with `needs` and `learn`, as in irl_gym.learners.base."
        )
    return found


def learner_of(name: str, options: dict[str, Any]) -> Any:
    """A learner with its options.

    Raises:
        UnknownLearner: see `learner_class`.
        InvalidParameter: an option that it does not have, or without which it cannot be.
    """
    made = learner_class(name)
    try:
        inspect.signature(made).bind(**options)
    except TypeError as error:
        known = ", ".join(inspect.signature(made).parameters) or "none"
        raise InvalidParameter(f"{name}: {error}: expected of its options, {known}, those it needs and no others.") from error
    return made(**options)
