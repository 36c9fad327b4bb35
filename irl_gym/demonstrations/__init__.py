"""Demonstrations in and out: Minari datasets, logs of all kinds (`imports/`), and what they say of a policy.

Open first: `datasets`, episodes written so that plain Minari opens them, and read from any. `export` writes any number of them
through any number of kills, by `shards`; `endings` says where an episode ends; `demonstrated` counts what the expert does;
`recorded` makes the environment of a dataset anew.
"""
