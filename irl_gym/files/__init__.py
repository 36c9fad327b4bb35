"""Files: our own, written whole or not at all, and anybody's, read as data: nothing is unpickled, imported or followed.

Open first: `own_files`, how a file is replaced and a folder is held; `run_folder`, a folder that is made stage by stage. From
strangers: `archives` (npz), `hdf5_files`, `arrow_files`, `pickles` are looked through before anything is read.
"""
