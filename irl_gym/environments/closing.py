"""Closing environments, whose `close` is a user's code: what it raises ends nothing, as nothing is asked of them any more."""

import contextlib
from typing import Any


def close(env: Any) -> None:
    """Close an environment, or several that step together; an error of theirs is let go, and they are not asked again."""
    with contextlib.suppress(Exception):
        env.close()
    if hasattr(env, "closed"):
        env.closed = True  # or a VectorEnv would ask again when it is forgotten
