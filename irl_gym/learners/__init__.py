"""Learners: frozen records of hyper-parameters that turn an MDP and an expert into a reward with a certificate.

Open first: `base`, what every learner is and gives. A family is one folder: `linear_programs/`.
"""
