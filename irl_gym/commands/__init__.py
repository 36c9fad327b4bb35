"""The command line, `irl-gym`, and what it alone needs; the scripts are doors of a few lines to it.

Open first: `door`, which finds the subcommand that is meant: a module with `command`, which reads its arguments before it
imports what it works with. `arguments`, `learning_arguments` and `csv_columns` are what `run` asks for, `terminal` is what all
of them say in the same way, `demonstrating/` who exports and who plays, `ng_russell_2000/` the paper.
"""
