"""Inverse reinforcement learning by linear programs (Ng & Russell 2000): three learners and their programs.

Open first: `finite` (section 3, a table), `feature` (section 4, large state spaces) or `trajectory` (section 5, episodes
alone). `programs` and `partial`, `soft` are what `finite` solves, `weights` what the other two share; `feature_rows` are the
rows of (10). `proofs/` recompute what each has proved.
"""
