"""What a learner needs that a run cannot give it, and how to ask for a run that can: in Python, and on the command line."""

from typing import Any

from irl_gym.errors import MissingPart
from irl_gym.learners.needs import OR, PARTS

OWN = "Call its `learn` with a Problem of your own."


def check_needs(learner: Any, env_id: str | None, dataset: str | None, epsilon: float, features: Any) -> None:
    """Check, before anything is worked out, that a run can give a learner what it needs of all but the world.

    Raises:
        MissingPart: it cannot.
    """
    lacks = {"also": ("a run is of one world", OWN)}
    if dataset is None:
        lacks["horizon"] = "a run knows one only of a dataset's episodes", OWN
    if features is None:
        told = "Give features, such as OneHot(16). (On the command line every run gives them to a learner that needs them.)"
        lacks["features"] = "no features are given", told
    if dataset is not None or epsilon:
        env = "the environment's id" if env_id is None else env_id
        told = f"Leave dataset out, and give env_id. (On the command line: --env-id {env} without --dataset or --csv.)"
        if dataset is None:
            told = "Leave epsilon out. (On the command line: the same without --epsilon.)"
        lacks |= dict.fromkeys(("expert", "oracle"), ("the expert is known by its episodes only", told))
    part = learner.needs.lacking({*PARTS} - {*lacks})
    if part is not None:
        why, mend = lacks[part.split(OR)[0]]
        raise MissingPart(f"{type(learner).__name__} needs {part}, and {why}: expected a run that has it. {mend}")
