"""A run's folder read back: whatever lies there may be anybody's, and is checked before it is believed.

Open first: `run_reader`, one file at a time. `belonging` asks whether the files are of one run, `verified` computes their
claims again, `unfinished` takes what a run that stopped has left.
"""
