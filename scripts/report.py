"""Write the page of a run again: `irl-gym report`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["report", *sys.argv[1:]]))
