"""The command line, and what it alone needs; the scripts are doors of a few lines to it.

Open first: `arguments`, what the loop's command line asks for. `terminal` is what all scripts say in the same way.
`demonstrators` are for exports; `playing`, `screens` and `keyboard` for a person who plays; `ng_russell_2000/` is the paper.
"""
