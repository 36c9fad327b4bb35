"""Files of our own are whole or not there, follow no link, leave nothing, and are nobody else's while they are written."""

import errno
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from tiny_env import TableEnv, lottery

from irl_gym.agents.planners import SB3
from irl_gym.errors import InvalidParameter, RunConflict, WriteFailed
from irl_gym.files import own_files
from irl_gym.files.own_files import LOCK, check_links, digest, held, scratch, sweep, whole, write_arrays, write_bytes
from irl_gym.files.run_folder import write_text
from irl_gym.judging.curves import curve_of, write_curve
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.plotting import save_figure
from irl_gym.runs.films import Film
from irl_gym.runs.metrics_csv import write_metrics_csv
from irl_gym.tables.table_files import save_table
from irl_gym.tables.tabulate import tabulate

fcntl = pytest.importorskip("fcntl")
DIES = """
import os, signal, sys
from irl_gym.files.own_files import scratch, whole
from pathlib import Path
with {call} as made:
    (made.write(b"half") or made.flush()) if hasattr(made, "write") else (made / "half").write_text("")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder):
    return sorted(one.name for one in folder.iterdir())


def killed(call, cwd):
    made = subprocess.run([sys.executable, "-c", DIES.format(call=call)], cwd=cwd, capture_output=True, text=True)
    assert made.returncode == -signal.SIGKILL, made.stderr


def agent():
    env = TableEnv(lottery(0.5), [1, 0])
    return SB3(total_timesteps=1, hyperparameters={"n_steps": 8, "batch_size": 8, "n_epochs": 1}).plan(env, gamma=0.9)


METRICS = {"policies": {}, "reward": {"l1_norm": 1.0}}
CONFIG = {"env_kwargs": {}, "learner": {}, "retrain": {}, "gamma": 0.9, "seed": 0}
WRITERS = {
    "a.txt": lambda path: write_text(path, "text"),
    "r.npz": TabularReward(np.ones(3)).save,
    "t.npz": lambda path: save_table(tabulate(TableEnv(lottery(0.5), [1, 0]), gamma=0.9, check_steps=0), path),
    "f.png": lambda path: save_figure(Figure((1, 1)), path),
    "a.zip": lambda path: agent().save(path),
    "c.csv": lambda path: write_curve(curve_of([1], [0.5], [np.ones(3)]), path),
    "m.csv": lambda path: write_metrics_csv(METRICS, path, env=None, config=CONFIG),
    "agent.json": lambda path: Film("agent", None, (), "cut").save(path.parent),
}


@pytest.mark.parametrize("name", WRITERS)
def test_no_writer_follows_a_link_at_its_file_or_at_a_name_it_writes_first(tmp_path, monkeypatch, name):
    outside, folder = tmp_path / "outside", tmp_path / "folder"
    outside.write_text("other people's")
    folder.mkdir()
    for planted in (name, f".{name}.tmp", f".{name}.tmp.npz", f".{name}.tmp.zip", ".irl_gym-0123456789abcdef.tmp"):
        (folder / planted).symlink_to(outside)
    tokens = iter(["0123456789abcdef"])  # even one that was foreseen
    monkeypatch.setattr("secrets.token_hex", lambda n: next(tokens))
    with pytest.raises(FileExistsError):
        WRITERS[name](folder / name)
    monkeypatch.undo()
    WRITERS[name](folder / name)
    assert outside.read_text() == "other people's" and not (folder / name).is_symlink() and (folder / name).stat().st_size


def test_names_that_are_written_first_cannot_be_foreseen(tmp_path):
    seen = set()
    for _ in range(20):
        with whole(tmp_path / "a"):
            seen |= set(names(tmp_path)) - {"a"}
    assert len(seen) == 20 and all(re.fullmatch(r"\.irl_gym-[0-9a-f]{16}\.tmp", one) for one in seen)


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_beside(tmp_path, error):
    (tmp_path / "a").write_text("old")
    with pytest.raises(type(error)), whole(tmp_path / "a") as file:
        file.write(b"half")
        raise error
    assert names(tmp_path) == ["a"] and (tmp_path / "a").read_text() == "old"


def test_a_file_has_the_rights_that_any_new_file_has(tmp_path):
    (tmp_path / "plain").touch()
    write_bytes(tmp_path / "ours", b"")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_file_may_have_the_longest_name_that_the_system_takes(tmp_path):
    write_bytes(tmp_path / ("a" * 255), b"x")
    assert names(tmp_path) == ["a" * 255]


def test_the_same_arrays_make_the_bytes_that_numpy_makes(tmp_path):
    arrays = {"a": np.eye(3), "b": np.array("text")}
    write_arrays(tmp_path / "ours.npz", arrays)
    np.savez(tmp_path / "numpys.npz", **arrays)
    assert (tmp_path / "ours.npz").read_bytes() == (tmp_path / "numpys.npz").read_bytes()


@pytest.mark.parametrize("call", ["whole(Path('a'))", "scratch(Path('.'))"])
@pytest.mark.parametrize("then", [lambda at: write_bytes(at / "b", b""), lambda at: _hold(at), sweep])
def test_what_a_killed_writer_left_is_removed_at_the_next_write_or_hold(tmp_path, call, then):
    killed(call, tmp_path)
    assert len(names(tmp_path)) == 1 and names(tmp_path)[0].startswith(".irl_gym-")
    then(tmp_path)
    assert not [one for one in names(tmp_path) if one != "b"]


def _hold(folder):
    with held(folder, "busy"):
        pass


def test_what_is_being_written_is_not_removed(tmp_path):
    with whole(tmp_path / "a") as file, scratch(tmp_path) as folder:
        file.write(b"first")
        sweep(tmp_path)
        write_bytes(tmp_path / "b", b"")
        (folder / "c").touch()
    assert names(tmp_path) == ["a", "b"] and (tmp_path / "a").read_bytes() == b"first"


def test_files_that_others_left_are_not_removed(tmp_path):
    others = [".a.tmp", "irl_gym-0123456789abcdef.tmp", ".irl_gym-0123.tmp", "#a#", ".config.json.tmp"]
    for name in others:
        (tmp_path / name).touch()
    _hold(tmp_path)
    assert names(tmp_path) == sorted(others)


def test_a_link_of_a_name_of_ours_is_not_followed_when_what_was_left_is_removed(tmp_path):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").touch()
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / ".irl_gym-0123456789abcdef.tmp").symlink_to(tmp_path / "kept")
    sweep(tmp_path / "in")
    assert names(tmp_path / "kept") == ["file"]


# --- who holds a folder ---


def test_a_folder_is_held_by_one_at_a_time(tmp_path):
    with held(tmp_path / "run", "somebody works there"):
        with pytest.raises(RunConflict, match="somebody works there"), held(tmp_path / "run", "somebody works there"):
            pass
    _hold(tmp_path / "run")


def test_a_folder_that_was_made_to_be_held_goes_if_nothing_was_written(tmp_path):
    _hold(tmp_path / "deep" / "run")
    assert names(tmp_path) == []


def test_a_folder_that_cannot_be_written_is_refused():
    with pytest.raises(RunConflict, match=r"/proc/nothing/here cannot be written .*: expected a folder of yours"):
        _hold(Path("/proc/nothing/here"))


def test_a_folder_that_was_there_stays_and_nothing_is_left_in_it(tmp_path):
    (tmp_path / "run").mkdir()
    _hold(tmp_path / "run")
    assert names(tmp_path) == ["run"] and names(tmp_path / "run") == []


def test_a_lock_that_is_a_link_is_not_followed(tmp_path):
    (tmp_path / "outside").write_text("other people's")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOCK).symlink_to(tmp_path / "outside")
    with pytest.raises(RunConflict, match=r"cannot be written .*\.lock"):
        _hold(tmp_path / "run")
    assert (tmp_path / "outside").read_text() == "other people's"


def test_a_lock_that_is_another_name_of_a_file_is_not_written_into(tmp_path):
    (tmp_path / "outside").write_text("other people's")
    (tmp_path / "run").mkdir()
    os.link(tmp_path / "outside", tmp_path / "run" / LOCK)
    _hold(tmp_path / "run")
    assert (tmp_path / "outside").read_text() == "other people's"


@pytest.mark.parametrize("again", [False, True])
def test_a_folder_that_is_deleted_while_it_is_held_is_said_to_be_gone(tmp_path, again):
    with pytest.raises(WriteFailed, match=r"run/\.lock is gone: expected it to stay"), held(tmp_path / "run", "busy"):
        shutil.rmtree(tmp_path / "run")
        if not again:
            raise KeyError("what came of it")
        (tmp_path / "run").mkdir()  # and made again, empty: what was in it is lost


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
@pytest.mark.parametrize("writing", [lambda path: held(path, "busy"), whole, lambda path: scratch(path.parent)])
def test_a_full_disk_is_told_with_a_mend(tmp_path, number, writing):
    told = rf"^{tmp_path}\S* cannot be written any more .* make room, and the same command continues"
    with pytest.raises(WriteFailed, match=told), writing(tmp_path / "run"):
        raise OSError(number, os.strerror(number))
    assert names(tmp_path) == []


def test_other_errors_are_left_as_they_are(tmp_path):
    with pytest.raises(PermissionError, match="not yours"), held(tmp_path / "run", "busy"):
        raise PermissionError(errno.EPERM, "not yours")


def test_where_there_are_no_locks_a_folder_is_held_all_the_same(tmp_path, monkeypatch):
    def refused(number, how):
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr(own_files.fcntl, "flock", refused)
    with held(tmp_path / "run", "busy"), whole(tmp_path / "run" / "a") as file:
        sweep(tmp_path / "run")
        file.write(b"x")
    assert names(tmp_path / "run") == ["a"]


def test_without_fcntl_files_are_whole_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(own_files, "fcntl", None)
    with held(tmp_path / "run", "busy"), scratch(tmp_path / "run") as folder:
        write_bytes(folder / "a", b"x")
        (folder / "a").replace(tmp_path / "run" / "a")
    assert names(tmp_path / "run") == ["a"]


# --- links ---


def test_a_link_that_leads_out_is_refused_by_name(tmp_path):
    (tmp_path / "run" / "deep").mkdir(parents=True)
    (tmp_path / "secret").write_text("")
    (tmp_path / "run" / "deep" / "reward.npz").symlink_to("../../secret")
    with pytest.raises(RunConflict, match=r"deep/reward\.npz is a link to .*secret, out of .*run: expected a file of its own"):
        check_links(tmp_path / "run")


def test_a_link_that_leads_in_a_circle_or_stays_inside_is_no_way_out(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    (tmp_path / "inside").symlink_to(tmp_path)
    check_links(tmp_path)


def test_a_folder_that_is_a_link_itself_is_taken(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    check_links(tmp_path / "link")
    _hold(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()


def test_what_is_neither_a_file_nor_a_folder_is_refused(tmp_path):
    os.mkfifo(tmp_path / "reward.npz")
    with pytest.raises(RunConflict, match=r"reward\.npz is neither a file nor a folder"):
        check_links(tmp_path)


def test_a_folder_in_place_of_a_file_is_refused_before_anything_is_written(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(InvalidParameter, match="a is a folder: expected a file"), whole(Path(tmp_path / "a")):
        pass
    assert names(tmp_path) == ["a"]


def test_a_digest_is_the_sha256_of_the_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    assert digest(tmp_path / "a") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
