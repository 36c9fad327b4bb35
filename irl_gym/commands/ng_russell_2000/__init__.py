"""The three experiments of Ng & Russell, "Algorithms for Inverse Reinforcement Learning" (ICML 2000), with this library.

Open first: `experiment_1`.
Each is a frozen record of settings whose `run` gives a frozen outcome: arrays, numbers, and checks against the paper. What the
paper leaves open is said where it is settled. `reproduction` runs, prints and draws them.
"""
