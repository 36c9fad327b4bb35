"""Render modes, as Gymnasium asks for them: named when an environment is made, or not rendered at all."""

from typing import Any

import gymnasium as gym

from irl_gym.errors import InvalidParameter


def check_render_mode(render_mode: str | None, metadata: dict[str, Any]) -> None:
    """Check a render mode against those that an environment's `metadata` lists.

    Raises:
        InvalidParameter: another one.
    """
    if render_mode not in (None, *metadata["render_modes"]):
        raise InvalidParameter(f"render_mode is {render_mode!r}: expected None or one of {metadata['render_modes']}.")


def warn_of_no_render_mode(env: gym.Env, offered: str) -> None:
    """Warn whoever renders an environment that was made without a render mode, and offer one."""
    name = env.spec.id if env.spec else type(env).__name__
    gym.logger.warn(f'render was called without a render mode: make it with gym.make("{name}", render_mode="{offered}").')
