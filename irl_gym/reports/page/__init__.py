"""A run as one page: HTML with everything in it, that opens from disk and fetches nothing.

Open first: `report`, the list of sections. `contents` is what they may need of a run, `sections/` what they show, `scene` what
those of states share, made of `panels` and `maps`; `document` puts `assets/` and data into one file.
"""
