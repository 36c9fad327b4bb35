"""Copies of environments: `stripped` of what only watches, and `snapshots` of their inner state, over any `object_graphs`.

What an environment raises when it is called is told by `calls`.
"""
