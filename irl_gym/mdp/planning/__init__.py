"""Planning on tables: values, optimal policies and occupancies, with bounds that hold with all rounding.

Open first: `dynamic_programming`, what everybody calls. `discounted` factorises I - gamma P_pi once, `precise` works in
extended precision, `howard` is policy iteration to the last bit, `envelopes` bounds discounted sums over all policies.
"""
