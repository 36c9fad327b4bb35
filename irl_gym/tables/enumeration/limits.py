"""When an enumeration stops, and how it counts what it cannot enumerate."""

from dataclasses import dataclass

from irl_gym.checks import checked_number


@dataclass(frozen=True)
class Limits:
    """Limits of an enumeration.

    Raises:
        InvalidParameter: a field outside its range.
    """

    max_states: int = 300_000
    """States found at most."""
    max_seconds: float | None = None
    """Seconds at most; None for no limit."""
    max_bytes: float = 4e9
    """Bytes that states, steps and waiting copies may take."""
    most_outcomes: int = 20_000
    """Outcomes of one step or reset that are enumerated; where there are more, they are counted."""
    runs: int = 1_000
    """Runs of a step whose draws cannot be enumerated."""
    start_runs: int = 10_000
    """Runs of a reset whose draws cannot be enumerated."""
    revisits: int = 3
    """Other inner states in which an observation is tried again, to find out whether it hides something; 0 to trust it."""
    seed: int = 0
    """Of runs that are counted."""

    def __post_init__(self) -> None:
        for name in ("max_states", "most_outcomes", "runs", "start_runs"):
            checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)
        for name in ("revisits", "seed"):
            checked_number(name, getattr(self, name), "a whole number of at least 0", least=0, whole=True)
        checked_number("max_bytes", self.max_bytes, "a number above 0", above=0)
        if self.max_seconds is not None:
            checked_number("max_seconds", self.max_seconds, "seconds above 0, or None", above=0)
