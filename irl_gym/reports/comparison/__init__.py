"""compare.html: several runs on one page, of one environment or of several.

Open first: `comparison_page`. `shared_worlds` is what the runs have in common, `ranked` which is best, `pooled` what seeds say.
"""
