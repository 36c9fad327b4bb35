"""The facade: few names, nothing heavy until it is used."""

import subprocess
import sys

import irl_gym

HEAVY = ("pydantic", "torch", "cvxpy", "minari", "matplotlib", "ray", "stable_baselines3", "gymnasium", "scipy")


def test_every_name_of_the_facade_is_there():
    assert all(getattr(irl_gym, name) is not None for name in irl_gym.__all__)


def test_the_facade_has_at_most_34_names():
    assert len(irl_gym.__all__) <= 34


def test_importing_loads_nothing_heavy():
    code = f"import sys, irl_gym; print([name for name in {HEAVY} if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_importing_loads_no_other_module_of_the_library():
    code = "import sys, irl_gym; print(sorted(name for name in sys.modules if name.startswith('irl_gym')))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "['irl_gym']"
