"""Copies of environments: `stripped` of what only watches, and `snapshots` of their inner state, over any `object_graphs`.

Open first: `snapshots`, a state that is kept and gone back to.
Arrays that share memory share it in copies (`shared_memory`); nothing in a copy leads back (`apart`). Large parts that never
change are `constants`, whose `contents` are looked at after every step. What an environment raises is told by `calls`.
"""
