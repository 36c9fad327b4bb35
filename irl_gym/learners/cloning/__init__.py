"""Behaviour cloning: a policy that does what the demonstrations show, without a reward and without an environment.

    pi(a | s) = (n(s, a) + alpha) / (n(s) + A alpha),    n(s, a) how often the demonstrations take a in s
A table of counts can be anything, so it errs only where there are no demonstrations. Classes that cannot be anything err even
with infinitely many: one distribution a cell of states (`Clone(cells=...)`), or a softmax of features (`SoftmaxClone`). A clone
that errs with eps a step loses up to T^2 eps over T steps (Ross & Bagnell 2010, theorem 2.1): a mistake leads to where the
expert never was. Open first: `clone`; then `softmax`, and
`irl_gym.agents.neural_clone`, which needs torch. `nearest` says what is near on a table, `proofs` what is certain.
"""
