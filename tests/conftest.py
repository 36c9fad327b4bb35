"""Shape annotations are checked while the tests run; hypothesis is seeded and has no clock."""

import shutil

import typechecker

typechecker.install()

import gymnasium as gym  # noqa: E402  (nothing of irl_gym may be imported before the hook)
import hypothesis  # noqa: E402
import jaxtyping  # noqa: E402
import pytest  # noqa: E402

for profile, examples in (("irl_gym", 15), ("thorough", 100)):  # the second by `make bars`
    hypothesis.settings.register_profile(profile, deadline=None, derandomize=True, max_examples=examples, database=None)
hypothesis.settings.load_profile("irl_gym")


def pytest_configure(config):
    # Gymnasium's Tuple and Dict spaces derive from typing.Sequence and typing.Mapping, which beartype frowns at.
    config.addinivalue_line("filterwarnings", "ignore::beartype.roar.BeartypeDecorHintPep585DeprecationWarning")


def pytest_runtest_setup():
    typechecker.begin()


@pytest.fixture(autouse=True, scope="session")
def logs_of_sb3(tmp_path_factory):
    """Models that tests train by themselves log into pytest's own folders; else SB3 leaves a folder of each in the system's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SB3_LOGDIR", str(tmp_path_factory.mktemp("sb3")))
        yield


KWARGS = {
    "FrozenLake 4x4 slippery": ("FrozenLake-v1", {"map_name": "4x4", "is_slippery": True}),
    "FrozenLake 4x4": ("FrozenLake-v1", {"map_name": "4x4", "is_slippery": False}),
    "FrozenLake 8x8 slippery": ("FrozenLake-v1", {"map_name": "8x8", "is_slippery": True}),
    "FrozenLake 8x8": ("FrozenLake-v1", {"map_name": "8x8", "is_slippery": False}),
    "CliffWalking": ("CliffWalking-v1", {}),
    "CliffWalking slippery": ("CliffWalkingSlippery-v1", {}),
    "Taxi": ("Taxi-v4", {}),
    "GridWorld": ("irl_gym_envs:irl_gym/GridWorld-v0", {}),
    "FourRooms": ("irl_gym_envs:irl_gym/FourRooms-v0", {}),
}


@pytest.fixture(scope="session")
def toy_text():
    """Tables of Gymnasium's environments and ours with gamma 0.99, by the names of references.md; each made once, unchecked."""
    from irl_gym.tables.tabulate import tabulate  # here, so that the filter of pytest_configure is in force

    made = {}

    def get(name):
        if name not in made:
            env_id, kwargs = KWARGS[name]
            made[name] = tabulate(gym.make(env_id, **kwargs), gamma=0.99, check_steps=0)
        return made[name]

    return get


@pytest.fixture
def unchecked():
    """Annotations are not checked in this test, so that the library's own check of an argument is reached."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture(scope="module")
def without_figures():
    """The runs of these tests draw none, which take the time."""
    from irl_gym.loop.loop import MAKERS

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(MAKERS, "figures", ())
        yield


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The folder of the finished run of `lake_run`, which is copied before it is changed."""
    from lake_run import COMMAND, asked

    from irl_gym.loop.pipeline import recover_and_retrain

    out = tmp_path_factory.mktemp("runs") / "lake"
    recover_and_retrain(asked(), out, command=COMMAND)
    return out


@pytest.fixture(scope="session")
def policy_run(tmp_path_factory):
    """Gives the folder of a finished run of `lake_run.of_policies`, without figures; each is made once."""
    from lake_run import of_policies

    from irl_gym.loop.loop import MAKERS
    from irl_gym.loop.pipeline import recover_and_retrain

    made = {}

    def get(name, seed=0):
        if (name, seed) not in made:
            made[name, seed] = tmp_path_factory.mktemp("runs") / f"{name}-{seed}"
            with pytest.MonkeyPatch.context() as patch:
                patch.setitem(MAKERS, "figures", ())
                recover_and_retrain(of_policies(name, seed), made[name, seed])
        return made[name, seed]

    return get


@pytest.fixture
def copied(finished, tmp_path):
    """A copy of a finished run."""
    return shutil.copytree(finished, tmp_path / "copy")


@pytest.fixture
def unvouched(copied):
    """The same without digests, as of an earlier version."""
    from forgetting import without_digests

    return without_digests(copied)
