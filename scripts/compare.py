"""Put runs side by side: `irl-gym compare`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["compare", *sys.argv[1:]]))
