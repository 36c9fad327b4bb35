"""One random call of plain Python to its exact distribution: generators are driven along every path of outcomes.

Open first: `exact_draws`, from a call to its outcomes; `draw_tree` walks them. `driven` are the methods of `random.Random`,
`driven_numpy` those of NumPy's generators, `driven_modules` the functions of both modules; `uniforms` are uniform numbers that
are not drawn, only compared.
"""
