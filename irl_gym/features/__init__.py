"""Features phi, and rewards that are linear in them: R = alpha . phi (Ng & Russell 2000, equation (8)).

Open first: `feature_maps`, what a feature map is, and those of integers; `bases` has those of coordinates. `linear_reward` is
the reward, `feature_sums` the discounted sums along episodes of equation (11).
"""
