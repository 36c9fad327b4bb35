"""Who acts and learns: exact planners, agents of Stable-Baselines3, and experts of all kinds.

Open first: `planners`, environments to policies, for experts and retrained agents alike. `experts` come from outside,
`expert_files` from a file, `noise` makes them err; `shown_observations` are what an agent sees in place of observations;
`simulator` is a world that can be run and solved for a reward. `neural_clone` is the learner of policies that needs torch,
`neural_training` what it does with it.
"""
