"""Finite MDPs as mathematics: P, policies, rewards, episodes, and whether an expert is optimal under a reward.

Open first: `tabular_mdp`, P with gamma and d0 and no reward. Beside it `policies`, `rewards`, `episodes`, `sampling`,
`shaping`. `planning/` solves. `optimality_rows` are the rows of (4) of Ng & Russell (2000), `margins` and `sampling_error` what
each is worth and how sure that is, `optimality` decides by the value at stake.
"""
