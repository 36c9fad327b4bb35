"""Observations as row numbers, and what people call them.

Open first: `states`, the one numbering of the states, observations to rows and back. `integer_spaces` says how an observation
is a few integers, `listed_states` numbers only some, `batches` are many at once; `names` and `coordinates` are for people,
`space_json` for files.
"""
