"""Seconds that several programs have together: a clock that starts once, and is asked before each of them."""

import math
import time
from dataclasses import dataclass

from irl_gym.checks import checked_number


@dataclass(frozen=True)
class Deadline:
    """When what was begun has to be finished. Processes of one machine share it."""

    seconds: float | None
    """That were given; None for no limit."""
    until: float
    """By the monotonic clock, in seconds; infinite for no limit."""

    @classmethod
    def after(cls, seconds: float | None) -> "Deadline":
        """The clock starts now.

        Args:
            seconds: above 0; None for no limit.

        Raises:
            InvalidParameter: not above 0.
        """
        if seconds is None:
            return NEVER
        return cls(seconds, time.monotonic() + checked_number("time_limit", seconds, "seconds above 0, or None", above=0))

    @property
    def left(self) -> float:
        """Seconds, at least 0; infinite for no limit."""
        return max(self.until - time.monotonic(), 0.0)


NEVER = Deadline(None, math.inf)
"""No limit."""
