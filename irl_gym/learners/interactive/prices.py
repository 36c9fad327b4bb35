"""What an action costs more than going on as the oracle does: AggreVaTe's cost-sensitive labels (Ross & Bagnell 2014).

    c(s, a) = V*(s) - Q*(s, a) = -A*(s, a),    V* the value of the oracle's own policy under the true reward
    V*(d0) - V_pi(d0) = sum_s d_pi(s) sum_a pi(a | s) c(s, a)      (Kakade & Langford 2002, lemma 6.1)
Departs: of a table all costs of a visited state are known, and none is estimated by trying one action and rolling out.
Axes: S states, A actions.
"""

from typing import Any

from irl_gym._typing import Matrix
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.mdp.planning.dynamic_programming import backup, policy_evaluation
from irl_gym.mdp.policies import TabularPolicy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP


def prices(oracle: Any, mdp: TabularMDP | None, reward: TabularReward | None) -> Matrix:
    """(S, A) what each action costs; below 0 where it is better than what an oracle does that errs.

    Raises:
        InvalidParameter: the table, the reward or the oracle's own table is not known.
    """
    policy = oracle.policy
    if mdp is None or reward is None or not isinstance(policy, TabularPolicy):
        given = {"no table": mdp is None, "no reward": reward is None, f"an oracle that is {a_type(policy)}": True}
        lacks = next(name for name, missing in given.items() if missing)
        raise InvalidParameter(
            f"cost is 'advantage', and there is {lacks}: expected a table, its reward, and an oracle that is a table of "
            "actions, `Oracle(TabularPolicy(probabilities, states))`. Or use cost='mistakes'."
        )
    R = reward.expected(mdp)
    V = policy_evaluation(mdp, R, policy.probabilities)
    return V[:, None] - backup(mdp, R, V)
