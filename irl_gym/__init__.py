"""irl_gym: inverse reinforcement learning for Gymnasium.

The names below are imported when first used; `import irl_gym` itself loads no torch, cvxpy, minari or matplotlib.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
