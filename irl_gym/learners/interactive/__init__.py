"""Interactive imitation: learners that ask the expert what it would do where they come to themselves.

    d_pi(s)    how often pi comes to s
    a clone    errs where the expert never was: its mistakes are few under d_expert, and what it loses grows with T^2
    DAgger     learns from labels under its own d_pi: u T eps + O(1), u the most that one other action costs
(Ross & Bagnell 2010, theorem 2.1; Ross, Gordon & Bagnell 2011, theorem 3.2.) Every query is counted (`Oracle.queries`).
Open first: `dagger`; `labels` asks, `visits` says where the learner comes to, `proofs` what is certain.
"""
