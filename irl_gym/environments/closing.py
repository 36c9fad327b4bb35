"""Closing environments, whose `close` is a user's code: what it raises ends nothing, as nothing is asked of them any more."""

import contextlib
from typing import Any

from gymnasium.vector import VectorEnv


def close(env: Any) -> None:
    """Close an environment, or several that step together; an error of theirs is let go, and they are not asked again."""
    with contextlib.suppress(Exception):
        env.close()
    if isinstance(env, VectorEnv):
        with contextlib.suppress(Exception):  # `closed` may be somebody's own, too
            env.closed = True  # or it would ask again when it is forgotten
