"""The states of any environment that can be copied, found one by one.

From the ground up: `uniforms`, `driven` and `draws` list the outcomes of a call's draws; `trials` makes a call in all of them,
on snapshots; `explorer` searches, `explored` is what it found, `replays` goes there again, `hidden_state` is what it may find
wrong; `table` makes the table.
"""
