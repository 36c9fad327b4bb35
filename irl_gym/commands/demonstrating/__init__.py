"""Who demonstrates: an expert whose episodes are exported, or a person who plays.

Open first: `demonstrators`, any expert in any environment, for exports. `playing` is the whole game without a screen; `screens`
and `keyboard` are what it is seen on and steered with.
"""
