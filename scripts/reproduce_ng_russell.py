"""Reproduce Ng & Russell (2000): `irl-gym reproduce ng-russell-2000`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["reproduce", "ng-russell-2000", *sys.argv[1:]]))
