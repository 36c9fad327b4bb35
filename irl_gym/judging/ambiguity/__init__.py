"""How much of a reward the expert leaves open: the feasible set, its width, the optimal face and the path of lambda.

Open first: `feasible`, all rewards under which the expert is optimal; `widths`, how far apart those of one state can be.
`uniqueness` asks whether a learned reward is the only optimum, `lambda_path` follows it as the price of ||R||_1 rises. Below
these: `reward_sets` and `priced_rewards` are polytopes, `extremes` their ends, `envelope`, `priced` and `path_changes` the
path's parts.
"""
