"""Write an expert's episodes as a dataset: `irl-gym export`, called in a clone."""

import sys

from irl_gym.commands.door import main

if __name__ == "__main__":
    sys.exit(main(["export", *sys.argv[1:]]))
