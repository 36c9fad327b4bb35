"""Learners: frozen records that turn a `Problem` into an `Outcome`: a reward, a policy or both.

Open first: `base`, what every learner is and gives. `needs` and `problem` are Table 1 of the lecture notes, `registry` finds
learners by name. A family is one folder: `linear_programs/`, `cloning/`.
"""
