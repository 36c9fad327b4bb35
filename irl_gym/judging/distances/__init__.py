"""How far apart two rewards are, not counting differences that no policy notices.

Open first: `exact`, distances on a table; `sampled` has those from samples.
Two rewards that differ in scale, or by a potential, have the same optimal policies: their raw values say nothing. A distance
takes a *canonical* form of each, in which such differences are gone, and compares these.

    pearson, spearman   correlation of canonical rewards
    epic                Pearson on the canonical form of Gleave et al. (2021)
    dard                Pearson on the canonical form of Wulfe et al. (2022)
    starc               the norm of a difference of canonical and standardised rewards (Skalse et al. 2024)
    sampled_...         the same from samples, for rewards that are functions of observations, with a standard error

Each is between 0 and 1, symmetric, 0 from a reward to itself, and keeps the triangle inequality; two rewards can have
distance 0 without being the same. What each ignores, when it is computed from a table:
                                     epic   dard   starc   starc, levelled=False
    positive scaling                 yes    yes    yes     yes
    potential shaping, 0 at ends     yes    (1)    yes     yes
    S'-redistribution                no     no     yes     no
    a constant, no state terminal    yes    yes    yes     yes
    a constant, where episodes end   no     yes    no      no
S'-redistribution moves payments among the successors of (s, a) and keeps their mean. (1): see `canonical.ModelDraws`.
"""

from irl_gym.judging.distances.canonical import AsGiven, FreshDraws, MinimalNorm, ModelDraws, ValueAdjustedLevelling
from irl_gym.judging.distances.exact import (
    DARD,
    EPIC,
    STARC,
    Pearson,
    Spearman,
    dard,
    distance_matrix,
    epic,
    pearson,
    spearman,
    starc,
)
from irl_gym.judging.distances.jackknife import Distance
from irl_gym.judging.distances.models import TableModel
from irl_gym.judging.distances.sampled import sampled_epic, sampled_pearson, sampled_spearman
from irl_gym.judging.distances.sampled_models import sampled_dard, sampled_starc
from irl_gym.judging.distances.transitions import FreshSample, Transitions

__all__ = [
    "DARD",
    "EPIC",
    "STARC",
    "AsGiven",
    "Distance",
    "FreshDraws",
    "FreshSample",
    "MinimalNorm",
    "ModelDraws",
    "Pearson",
    "Spearman",
    "TableModel",
    "Transitions",
    "ValueAdjustedLevelling",
    "dard",
    "distance_matrix",
    "epic",
    "pearson",
    "sampled_dard",
    "sampled_epic",
    "sampled_pearson",
    "sampled_spearman",
    "sampled_starc",
    "spearman",
    "starc",
]
