"""The states of any environment that can be copied, found one by one.

Open first: `table`, which searches and makes the table.
From the ground up: `tables.draws` lists the outcomes of a call's draws; `trials` makes a call in all of them,
on snapshots; `explorer` searches, `explored` is what it found, `replays` goes there again, `recheck` asks whether an earlier
search still holds, `hidden_state` is what it may find wrong, `deep_walks` looks for it late.
"""
