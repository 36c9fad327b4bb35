"""Reproduce Abbeel & Ng (2004): `irl-gym reproduce abbeel-ng-2004`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["reproduce", "abbeel-ng-2004", *sys.argv[1:]]))
