"""Proofs: what each learner proves of its program, recomputed; nothing is taken from the solver's word.

Open first: `finite_proof`. `soft_proof`, `feature_proof` and `trajectory_proof` are the other learners'; `proven` is what all
say of their program's optimum, `dual_bound` the bound that any multipliers give.
"""
