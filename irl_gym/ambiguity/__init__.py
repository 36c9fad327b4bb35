"""How much of a reward the expert leaves open: the feasible set, its width, the optimal face and the path of lambda."""
