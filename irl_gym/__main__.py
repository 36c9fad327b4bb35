"""`python -m irl_gym` is `irl-gym`."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main())
