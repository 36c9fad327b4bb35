"""The sections of a run's page, each a function of what it shows.

Open first: `section`, what a section is; `absent` says why one is not there. `verdict` and the table of policies stand first,
then `compared`, `slider`, `training`, `episodes`; `proof` is the certificate, the doctor and the table, `asked` how to run it
again.
"""
