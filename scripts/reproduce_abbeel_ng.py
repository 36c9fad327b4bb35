"""Reproduce the cloning curves of Abbeel & Ng (2004): a door to `irl_gym.commands.abbeel_ng_2004`, called in a clone."""

import sys

from irl_gym.commands.abbeel_ng_2004.reproduction import command

if __name__ == "__main__":
    sys.exit(command(sys.argv[1:]))
