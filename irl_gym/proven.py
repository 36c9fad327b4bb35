"""What every certificate says of its program's optimum, and how json holds it."""

import math
from typing import Any

import numpy as np


class Proven:
    """What every certificate says of the program's optimum."""

    objective: float
    dual_bound: float

    @property
    def duality_gap(self) -> float:
        """dual_bound - objective: how far the reward can be from the optimum."""
        return self.dual_bound - self.objective

    @property
    def optimality(self) -> str:
        """The same in a line that a person reads."""
        return f"objective                {self.objective:.6g}, at most {max(self.duality_gap, 0.0):.1e} below the optimum"

    def to_json(self) -> dict[str, Any]:
        """The certificate as json holds it: NaN and infinity become None."""
        return plain(self, "duality_gap", "degenerate")


def plain(certificate: Any, *properties: str) -> dict[str, Any]:
    """The fields of a certificate, and some of its properties, as json holds them: NaN and infinity become None."""
    found: dict[str, Any] = {}
    for name in (*certificate.__dataclass_fields__, *properties):
        value = getattr(certificate, name)
        if isinstance(value, np.ndarray):
            found[name] = [None if v != v else v for v in value.tolist()]
        else:
            found[name] = None if isinstance(value, float) and not math.isfinite(value) else value
    return found
