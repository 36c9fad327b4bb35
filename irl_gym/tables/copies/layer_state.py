"""One layer of an environment, as the attributes that belong to its inner state."""

from typing import Any

import gymnasium as gym

from irl_gym.tables.copies.object_graphs import SHARED, slots

SPACES = frozenset({"observation_space", "action_space", "_observation_space", "_action_space"})
LEFT_OUT = SHARED | SPACES | {"env", "render_mode", "_np_random_seed"}


class LayerState:
    """The attributes of one layer, read and written together."""

    def __init__(self, layer: gym.Env):
        self.layer = layer
        self.prefix = f"{type(layer).__name__}." if isinstance(layer, gym.Wrapper) else ""
        self.slots = [name for name in slots(type(layer)) if name not in LEFT_OUT]

    def read(self) -> dict[str, Any]:
        """Names and values now."""
        values = {name: value for name, value in self.layer.__dict__.items() if name not in LEFT_OUT}
        for name in self.slots:
            if hasattr(self.layer, name):
                values[name] = getattr(self.layer, name)
        return values

    def write(self, values: dict[str, Any]) -> None:
        """Have these attributes and no others."""
        own = self.layer.__dict__
        for name in [name for name in own if name not in values and name not in LEFT_OUT]:
            del own[name]
        for name in self.slots:
            if name in values:
                setattr(self.layer, name, values.pop(name))
            elif hasattr(self.layer, name):
                delattr(self.layer, name)
        own.update(values)
