"""Tables that are counted from samples, and what counting leaves open.

Open first: `counting`, from interaction or from a dataset to a table. `step_counts` are what episodes hold, `counted_rows` the
rows of P. Beside this room, for all tables: `value_error`, how far off values can be, and `repeats`, whether chance alone
decides what follows.
"""
