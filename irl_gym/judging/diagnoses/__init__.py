"""What can be wrong with a learned reward: one function for each sentence, each from a `Case` to a `Finding` or None.

Open first: `doctor`, which asks them all, in order of importance. A `case` is the evidence, `evidence` what of it is there,
`findings` what is said, `mends` what to do; the other files are the sentences, by their subject.
"""
