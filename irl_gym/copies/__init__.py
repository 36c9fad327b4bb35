"""Copies of environments: `stripped` of what only watches, and `snapshots` of their inner state, over any `object_graphs`."""
