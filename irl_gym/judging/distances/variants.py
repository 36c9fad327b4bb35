"""Distances by the names that tables of them give: every one that a paper recommends, and raw values beside them."""

from collections.abc import Mapping

import numpy as np

from irl_gym.judging.distances.canonical import AsGiven, MinimalNorm, ValueAdjustedLevelling
from irl_gym.judging.distances.exact import DARD, EPIC, STARC, Pearson, RewardDistance, Spearman

VARIANTS: Mapping[str, RewardDistance] = {
    "STARC, VAL": STARC(),
    "STARC, minimal norm": STARC(MinimalNorm()),
    "STARC, VAL, L1": STARC(norm=1, metric=1),
    "STARC, VAL, L infinity": STARC(norm=np.inf, metric=np.inf),
    "STARC, VALPotential": STARC(ValueAdjustedLevelling(levelled=False)),
    "EPIC": EPIC(),
    "DARD": DARD(),
    "Spearman": Spearman(),
    "raw Pearson": Pearson(AsGiven()),
}

LEVELLED = ("STARC, VAL", "STARC, minimal norm", "STARC, VAL, L1", "STARC, VAL, L infinity")
"""Those that are 0 for S'-redistribution too."""
