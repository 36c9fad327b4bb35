"""Array types, and the legend of the axis letters.

S states, A actions, K features, T steps, N episodes or points, d coordinates.
A pair (s, a) is row s * A + a of every stacked table.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int

Vector = Float[np.ndarray, "S"]  # one number a state
Matrix = Float[np.ndarray, "S A"]  # one number a state and action
Actions = Int[np.ndarray, "S"]  # one action a state
ActionSets = Bool[np.ndarray, "S A"]  # a set of actions a state
StateMask = Bool[np.ndarray, "S"]
Indices = Int[np.ndarray, "_"]  # as many as there are
Axes = Float[np.ndarray, "d"]  # one number a coordinate
AxisMask = Bool[np.ndarray, "d"]
Points = Float[np.ndarray, "N d"]  # N continuous states of d coordinates
Choices = Int[np.ndarray, "N"]  # one action a point
Numbers = Float[np.ndarray, "N"]  # one number a point
Flags = Bool[np.ndarray, "N"]
if TYPE_CHECKING:
    Sparse = Any  # csr_array; SciPy's stubs give it a shape of None
else:
    Sparse = sp.csr_array
