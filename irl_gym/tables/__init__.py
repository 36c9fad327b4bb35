"""Any environment to a table: P, gamma, d0, the reward, the numbering of its states, and the evidence.

Open first: `tabulate`, which finds the way that fits; `tabulation` is what it gives. A table is published (`published_table`,
`published_model`, `blackjack`), found state by state (`enumeration/`, with `copies/` of the environment and exact `draws/`),
counted (`counted/`), or of cells (`discretize`). `selfcheck` compares it with `env.step`.
"""
