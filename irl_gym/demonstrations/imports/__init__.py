"""Anybody's demonstrations, as episodes.

Open first: `arrays`; `rows` is what all of them become.

    from_arrays     arrays and lists: one an episode, one long one, or padded
    from_frame      pandas, CSV, Parquet, with column names as arguments
    from_imitation  trajectories of the package imitation
    from_d4rl       D4RL's flat arrays, or an HDF5 file of them
    from_rollouts   Stable-Baselines3's rollout and replay buffers
    from_pairs      a stream of (observation, action) pairs

Each gives `Episode`s, which learners take and `write_minari` stores. Every row is checked before the first episode is given
(the stream's, episode by episode), so nothing is half-imported; the first that cannot be right is named, with its value. What
they are checked against is `env`, or `space` with `n_actions` (actions count from 0) or `action_space` (they count from its
start). Logs seldom hold the observation after the last action: the action is kept all the same, and
`irl_gym.demonstrations.imports.rows` says what else `last` can do. Rewards
that are not known are 0.0: no learner reads them, and a report pays the expert of such a dataset by the table. Seeds are
not known, and None.
"""

from irl_gym.demonstrations.imports.arrays import from_arrays
from irl_gym.demonstrations.imports.buffers import from_rollouts
from irl_gym.demonstrations.imports.frames import from_frame
from irl_gym.demonstrations.imports.pairs import from_pairs
from irl_gym.demonstrations.imports.trajectories import from_d4rl, from_imitation

__all__ = ["from_arrays", "from_d4rl", "from_frame", "from_imitation", "from_pairs", "from_rollouts"]
