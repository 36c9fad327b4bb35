"""Play with the keyboard: `irl-gym play`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["play", *sys.argv[1:]]))
