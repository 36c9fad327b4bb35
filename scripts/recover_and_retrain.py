"""Recover a reward, retrain an agent on it, and judge it: `irl-gym run`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["run", *sys.argv[1:]]))
