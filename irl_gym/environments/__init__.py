"""Environments: a table as one, learned rewards in one, and wrappers that show what one hides.

Open first: `tabular_env` and `tabular_vec_env`, a table that steps; `learned_reward`, a learned reward in place of its own.
`reveal` and `seeded_starts` make hidden state part of the observation; `rollouts` plays many episodes at a time; `physics` and
`generative` are worlds that can be set to any state.
"""
