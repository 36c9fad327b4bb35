"""Say what is wrong with the reward of a run: `irl-gym doctor`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["doctor", *sys.argv[1:]]))
