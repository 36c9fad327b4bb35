"""Is it right? What a policy is worth, what a reward allows, and what remains open.

Open first: `metrics`, exact on tables; `scores` and `shares` put values on the scale from random actions to the expert.
`distances/` between rewards, `ambiguity/` of the feasible set, `diagnoses/` of what went wrong; `curves` are learning curves;
`measures` lists all that is measured, `evaluation` judges policies by it; `confirmation` and `estimated` are for counted
tables.
"""
