"""Seconds that several programs have together: a clock that starts once, and is asked before each of them."""

import math
import time
from dataclasses import dataclass

from irl_gym.checks import checked_number
from irl_gym.errors import SolverTimeout


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

    def check(self) -> None:
        """Go on only while there is time.

        Raises:
            SolverTimeout: there is none left.
        """
        if not self.left:
            raise self.late()

    def late(self, reasons: str = "") -> SolverTimeout:
        """The error of a fit whose time is up."""
        why = f" ({reasons})" if reasons else ""
        return SolverTimeout(
            f"no answer in {self.seconds} s, which all steps of a fit have together{why}: raise time_limit, or choose the "
            "other solver, of a linear program."
        )


NEVER = Deadline(None, math.inf)
"""No limit."""
