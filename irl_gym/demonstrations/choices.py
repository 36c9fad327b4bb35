"""What may be done with the end of an episode that is not as it should be: words, apart from the code that does it."""

from typing import Literal

AfterEnd = Literal["refuse", "cut"]
"""Of an episode that goes on after its end: `irl_gym.demonstrations.endings`."""
Last = Literal["keep", "drop", "repeat", "row"]
"""Of an episode whose last observation is missing: `irl_gym.demonstrations.imports.rows`."""
