"""What a person sees of a run: figures, a page, and tables in the terminal.

Open first: `page/report`, a run as one page; `comparison/comparison_page`, several; `terminal_report`, a few tables. `plotting`
and its parts `drawing` and `cell_maps` draw with matplotlib.
"""
