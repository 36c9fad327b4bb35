"""The record of one run: what was asked, what was found, and how it is read back.

Open first: `experiment`, what was asked (by name: `named_parts`), and `run`, everything that stands in a finished folder.
`identity` says whose folder it is, `reading/` how it is read back, `diagnosed` asks the doctor; `pooling` takes seeds together;
`certificates`, `scorecard`, `summary`, `films`, `logs`, `metrics_csv` are its parts, and `supply` hands them to who needs them.
"""
