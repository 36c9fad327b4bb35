"""Learners: frozen records of hyper-parameters that turn an MDP and an expert into a reward with a proof."""
