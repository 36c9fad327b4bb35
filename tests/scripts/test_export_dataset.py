"""The script as a person runs it, by subprocess, and as a machine stops it."""

import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import minari
import pytest
from stopped import run_until
from yardstick import yard

SCRIPT = Path(__file__).parents[2] / "scripts" / "export_dataset.py"
ID = "lake/expert-v0"
LAKE = ("--env-id", "FrozenLake-v1", "--env-kwargs", "map_name=8x8", "--dataset-id", ID)


def command(*arguments):
    return [sys.executable, str(SCRIPT), *arguments]


@pytest.fixture
def run(script, tmp_path):
    return lambda *arguments: script("export_dataset", *arguments, cwd=tmp_path)


@pytest.fixture
def opened(monkeypatch):
    def load(root):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
        return minari.load_dataset(ID)

    return load


@pytest.mark.parametrize("kind", ["hdf5", "arrow"])
def test_plain_minari_opens_what_the_script_wrote(tmp_path, opened, kind, run):
    made = run(*LAKE, "--episodes", "30", "--format", kind, "--epsilon", "0.1", "--root", str(tmp_path))
    assert made.returncode == 0 and f"{ID}: 30 episodes" in made.stdout
    assert "\x1b" not in made.stderr and made.stderr.splitlines()[-1].startswith("writing: done in ")
    dataset = opened(tmp_path)
    assert sum(1 for _ in dataset.iterate_episodes()) == 30 and len(dataset.sample_episodes(4)) == 4
    assert dataset.recover_environment().spec.kwargs == {"map_name": "8x8"}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--dataset-id", "no version"), "InvalidParameter: dataset id 'no version' is malformed"),
        (("--episodes", "0"), "InvalidParameter: episodes is 0"),
        (("--env-id", "FrozenLaek-v1"), "UnknownEnvironment: environment 'FrozenLaek-v1'"),
        (("--reveal", "colour"), "InvalidParameter: reveal has 'colour'"),
        (("--env-id", "CartPole-v1", "--env-kwargs", "{}"), "Or choose ppo, dqn or a2c"),
    ],
)
def test_a_mistake_gets_one_clear_line_and_leaves_nothing(tmp_path, run, arguments, says):
    made = run(*LAKE, "--root", str(tmp_path), *arguments)
    assert made.returncode == 2 and says in made.stderr and "Traceback" not in made.stderr
    assert not list(tmp_path.iterdir())


def test_what_is_known_to_be_hidden_is_revealed(tmp_path, opened, run):
    made = run("--env-id", "Blackjack-v1", "--env-kwargs", "{}", "--dataset-id", ID, "--root", str(tmp_path), "--episodes", "3")
    assert made.returncode == 0, made.stderr
    assert set(opened(tmp_path).recover_environment().observation_space.spaces) == {"observation", "natural"}


@pytest.mark.slow
def test_what_is_hidden_and_asked_not_to_be_revealed_is_refused(tmp_path, run):
    taxi = ("--env-id", "Taxi-v4", "--env-kwargs", "fickle_passenger=true", "--dataset-id", ID, "--root", str(tmp_path))
    made = run(*taxi, "--episodes", "3", "--reveal", "none")
    assert made.returncode == 2 and "HiddenState" in made.stderr


def test_layouts_are_drawn_from_the_seeds_named(tmp_path, opened, run):
    made = run(*LAKE, "--start-seeds", "0", "--episodes", "3", "--root", str(tmp_path))
    assert made.returncode == 0, made.stderr
    (wrapper,) = opened(tmp_path).env_spec.additional_wrappers
    assert wrapper.name == "SeededStarts" and list(wrapper.kwargs["seeds"]) == [0]


def test_a_taken_id_is_refused(tmp_path, run):
    arguments = (*LAKE, "--episodes", "5", "--root", str(tmp_path))
    assert run(*arguments).returncode == 0
    again = run(*arguments)
    assert again.returncode == 2 and f"DatasetExists: dataset '{ID}' exists" in again.stderr


OFTEN = {"irl_gym.demonstrations.export:SHARD_BYTES": 3_000}
"""A shard is closed after a few episodes."""
EPISODES, ENTERED = 60, "irl_gym.demonstrations.export:size_of"
MOMENTS = [
    ("hdf5", ENTERED, 47), ("arrow", "irl_gym.demonstrations.export:write_files", 1),
    ("hdf5", "irl_gym.demonstrations.export:publish", 1),
    ("arrow", "irl_gym.demonstrations.export:_remove", 1),
]  # fmt: skip
"""Among the episodes, before the dataset is written, before it gets its name, and before what is left is cleared away."""


@pytest.fixture(scope="module")
def straight(process, tmp_path_factory):
    """Roots by format, each with a dataset in it that nobody interrupted."""
    roots = {kind: tmp_path_factory.mktemp(kind) for kind in ("hdf5", "arrow")}
    for kind, root in roots.items():
        made = process("export_dataset", *LAKE, "--episodes", EPISODES, "--format", kind, "--root", root, cwd=root)
        assert made.returncode == 0, made.stderr
    return roots


@pytest.mark.parametrize(("kind", "where", "nth"), MOMENTS)
def test_a_kill_at_any_stage_leaves_the_same_dataset(tmp_path, opened, straight, kind, where, nth, run):
    whole = straight[kind]
    arguments = (*LAKE, "--episodes", str(EPISODES), "--format", kind, "--root", str(tmp_path))
    made = run_until(SCRIPT, *arguments, where=where, nth=nth, sent=signal.SIGKILL, **OFTEN)
    assert made.returncode == -signal.SIGKILL, made.stderr
    assert any(tmp_path.glob(".exporting-*/shards/*.npz"))
    if not (tmp_path / ID / "data").exists():
        made = run(*arguments)
        assert made.returncode == 0, made.stderr
        assert [one.name for one in tmp_path.iterdir()] == ["lake"]
    if kind == "hdf5":
        files = [root / ID / "data" / "main_data.hdf5" for root in (whole, tmp_path)]
        assert files[0].read_bytes() == files[1].read_bytes()
    else:
        first, second = (opened(root).iterate_episodes() for root in (whole, tmp_path))
        assert [str(vars(one)) for one in first] == [str(vars(one)) for one in second]


def test_another_plan_is_refused_while_one_is_under_way(tmp_path, run):
    arguments = (*LAKE, "--episodes", str(EPISODES), "--root", str(tmp_path))
    run_until(SCRIPT, *arguments, where=ENTERED, nth=30, sent=signal.SIGKILL, **OFTEN)
    made = run(*arguments, "--seed", "1")
    assert made.returncode == 2 and "RunConflict" in made.stderr and "with seed 0: expected that, not 1" in made.stderr


def test_an_export_that_is_interrupted_says_how_to_go_on(tmp_path):
    arguments = (*LAKE, "--episodes", str(EPISODES), "--root", str(tmp_path))
    made = run_until(SCRIPT, *arguments, where=ENTERED, nth=30, sent=signal.SIGINT, **OFTEN)
    assert made.returncode == 130 and made.stderr.splitlines()[-1].startswith("Stopped. The same command continues")


def resident(process):
    """Megabytes in use."""
    with open(f"/proc/{process.pid}/status") as file:
        return next((int(line.split()[1]) / 1000 for line in file if line.startswith("VmRSS")), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hdf5", "arrow"])
def test_a_million_steps_take_few_yards_in_flat_memory(tmp_path, opened, kind):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    arguments = (*LAKE, "--steps", "1000000", "--format", kind, "--root", str(tmp_path))
    process = subprocess.Popen(command(*arguments), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    used = []
    while process.poll() is None:
        if used or any(tmp_path.glob(".exporting-*/shards/000000.npz")):
            used.append(resident(process))
        time.sleep(0.05)
    assert process.returncode == 0, process.stderr.read()
    process.stderr.close()
    yards, used = (resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before) / yard(), [one for one in used if one]
    print(f"{kind}: {yards:.0f} yards, {used[0]:.0f} MB at the first shard, {max(used):.0f} MB at most")
    assert yards < 1_000 and max(used) - used[0] < 200
    assert opened(tmp_path).total_steps >= 1_000_000
    if kind == "hdf5":
        with h5py.File(tmp_path / ID / "data" / "main_data.hdf5") as file:
            assert len(file) == opened(tmp_path).total_episodes
