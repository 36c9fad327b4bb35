"""Experiments of Abbeel & Ng, "Apprenticeship Learning via Inverse Reinforcement Learning" (ICML 2004), with this library.

Open first: `figure_4`, the cloning curves; `gridworld` is the world of section 5.1. `figures` draws, `reproduction` runs,
prints and writes. Each experiment is a frozen record of settings whose `run` gives a frozen outcome, as in `ng_russell_2000`.
"""
