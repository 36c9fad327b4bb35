"""Linear programs and linear systems: who solves them, and for how long.

Open first: `solvers`, a program to an answer; the only module that knows solver names. `warm_lp` is for many objectives of one
program, `linear_program` the bound that any multipliers give. What looks at no clock works in a process that is ended in time:
`killable` asks, `native` answers, `piped` is between them, `deadline` counts the seconds.
"""
