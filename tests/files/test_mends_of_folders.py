"""The mends that errors about folders of runs, files and exports name are executed, and serve."""

import errno
import json
import os
import re
import shutil

import gymnasium
import numpy as np
import pytest
from mended import told, unsaid
from minari.serialization import serialize_space
from numbered import Numbered

from irl_gym.demonstrations.datasets import described, load_minari
from irl_gym.demonstrations.export import Amount, export_dataset
from irl_gym.files import archives
from irl_gym.files.archives import read_arrays
from irl_gym.files.own_files import held, write_bytes
from irl_gym.files.run_folder import RunFolder

pytestmark = pytest.mark.usefixtures("unchecked")
LAKE = gymnasium.make("FrozenLake-v1")


# --- folders ---


def claimed(path, **config):
    return RunFolder(path, {"seed": 0} | config)


def occupied(path):
    path.mkdir()
    (path / "mine.txt").write_text("mine")
    return path


def other_run(path):
    claimed(path).run("one", lambda folder: {})
    return path


def staged(path, content):
    """A run with a finished stage, whose file was changed."""
    folder = claimed(path / "run")
    folder.run("one", writing)
    (folder.path / "a.txt").write_text(content)
    return folder


def writing(folder):
    (folder / "a.txt").write_text("ours")
    return {}


def unreadable(path):
    raise ValueError(path.read_text())


def remade(path):
    folder = claimed(path / "run")
    without(folder.path / "a.txt")
    return "kept" not in folder.run("one", writing) and (folder.path / "a.txt").read_text() == "ours"


def without(path):
    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    return path


def no_json(path):
    path.mkdir()
    (path / "config.json").write_text("{")
    return path


def hold(path, error=None):
    with held(path, "busy"):
        write_bytes(path / "kept", b"x")
        if error is not None:
            raise error
    return True


def moved(path):
    with held(path, "busy"):
        path.rename(path.with_name("elsewhere"))


def full(path):
    hold(path, OSError(errno.ENOSPC, "No space left on device"))


def linked(path):
    path.mkdir()
    (path.parent / "outside").write_text("theirs")
    (path / "one").symlink_to(path.parent / "outside")
    return path


def copied_in(path):
    target = (path / "one").resolve()
    (path / "one").unlink()
    shutil.copy(target, path / "one")
    return hold(path)


def piped(path):
    path.mkdir()
    os.mkfifo(path / "one")
    return path


def compressed(path, save=np.savez_compressed):
    path.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(archives, "FREE", 1000)
        save(path / "one.npz", one=np.zeros(100_000))
        return read_arrays(path / "one.npz")["one"].size


def told_of(path, **taken):
    """A dataset whose metadata lack what is None."""
    about = described("lake/told-v0", LAKE, None, None, "hdf5", {"algorithm_name": "numbers"})
    if not (path / "lake").exists():
        export_dataset(lambda folder: Numbered(), about, Amount(episodes=1), {}, root=path)
    file = path / "lake/told-v0/data/metadata.json"
    file.write_text(json.dumps({name: one for name, one in (json.loads(file.read_text()) | taken).items() if one is not None}))
    return load_minari("lake/told-v0", root=path)


# --- exports ---


def export(root, demonstrator=None, dataset_id="lake/one-v0", episodes=3, on_progress=None):
    about = described(dataset_id, LAKE, None, None, "hdf5", {"algorithm_name": "numbers"})
    made = export_dataset(lambda folder: demonstrator or Numbered(), about, Amount(episodes=episodes), {}, root=root,
                          on_progress=on_progress)  # fmt: skip
    return made.total_episodes == episodes


def unread(root):
    """An export is cut off, and its shards cannot be read for a while."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("irl_gym.demonstrations.shards.read_arrays", refused)
        return export(under_way(root))


def refused(path):
    raise OSError(errno.EIO, "Input/output error")


class Ends(Numbered):
    def episodes(self, first):
        yield from (one for one, _ in zip(super().episodes(first), range(2), strict=False))


def under_way(root):
    """A root in which an export was cut off."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("irl_gym.demonstrations.export.SHARD_BYTES", 1)
        export(root, Numbered(breaks_at=2))
    return root


def folder_of(root):
    return next(root.glob(".exporting-*"))


def damaged_meanwhile(root):
    """A shard is damaged after it was found whole, before it is copied."""

    def damage(stage, share):
        if stage == "writing":
            next(folder_of(root).glob("shards/*.npz")).write_bytes(b"PK")

    return export(under_way(root), on_progress=damage)


def replaced_by_a_link(root):
    folder = folder_of(under_way(root))
    folder.rename(root / "theirs")
    folder.symlink_to(root / "theirs")
    return root


def damaged_plan(root):
    (folder_of(under_way(root)) / "plan.json").write_text("{")
    return root


def told_to_delete(root, told):
    """The export, where what an error names was deleted."""
    without(root / re.search(r"[Dd]elete (?:\S*/)?(\.exporting-\w+)\.$", told)[1])
    return export(root)


CASES = [
    # folders of runs
    ("expected a new or empty folder. Choose another --out.",
     lambda path: claimed(occupied(path / "run")), lambda path: claimed(path / "another")),
    ("expected a run's configuration. Choose another --out.",
     lambda path: claimed(no_json(path / "run")), lambda path: claimed(path / "another")),
    ("Choose another --out,", lambda path: claimed(other_run(path / "run"), seed=1), lambda path: claimed(path / "another")),
    ("or delete the folder.",
     lambda path: claimed(other_run(path / "run"), seed=1), lambda path: claimed(without(path / "run"), seed=1)),
    ("by its sha256", lambda path: staged(path, "other").done("one"), lambda path: remade(path)),
    ("Delete it, and its stage is run again.",
     lambda path: staged(path, "other").load("a.txt", unreadable), lambda path: remade(path)),
    # files
    ("Was the folder moved or deleted? The same command begins anew where there is none.",
     lambda path: moved(path / "run"), lambda path: hold(path / "run")),
    ("What was finished is kept: make room, and the same command continues.",
     lambda path: full(path / "run"), lambda path: (path / "run" / "kept").exists() and hold(path / "run")),
    ("Move it away,", lambda path: write_bytes(path, b"x"), 
     lambda path: path.rename(path.with_name("away")) and write_bytes(path, b"x") is None),
    ("or write elsewhere.", lambda path: write_bytes(path, b"x"), lambda path: write_bytes(path / "file", b"x") is None),
    ("Choose another place.",
     lambda path: hold(occupied(path / "run") / "mine.txt" / "run"), lambda path: hold(path / "elsewhere")),
    ("Copy what it leads to into its place,", lambda path: hold(linked(path / "run")), lambda path: copied_in(path / "run")),
    ("or delete it.",
     lambda path: hold(linked(path / "run")), lambda path: without(path / "run" / "one") and hold(path / "run")),
    ("expected what a run leaves. Delete it.",
     lambda path: hold(piped(path / "run")), lambda path: without(path / "run" / "one") and hold(path / "run")),
    ("If it is yours, write it without compression", compressed, lambda path: compressed(path, np.savez) == 100_000),
    ("add it, as minari.serialization.serialize_space writes it", lambda path: told_of(path, observation_space=None),
     lambda path: told_of(path, observation_space=serialize_space(LAKE.observation_space))),
    # exports
    ("Give one that goes on.", lambda root: export(root, Ends()), export),
    ("expected what an export of yours left. Delete it.",
     lambda root: export(replaced_by_a_link(root)), lambda root: without(folder_of(root)) and export(root)),
    ("Nothing is lost; ask again when it can.", unread, export),
    ("Ask for the same again: its episodes, and those after them, are then made anew.", damaged_meanwhile, export),
    ("Ask for the same again to finish it,", lambda root: export(under_way(root), episodes=5), export),
    ("choose another id,",
     lambda root: export(under_way(root), episodes=5), lambda root: export(root, dataset_id="lake/two-v0", episodes=5)),
    ("or delete ", lambda root: export(under_way(root), episodes=5),
     lambda root: without(folder_of(root)) and export(root, episodes=5)),
    ("expected the plan of an export. Delete",
     lambda root: export(damaged_plan(root)), lambda root: told_to_delete(root, told(export, root))),
]  # fmt: skip
FILES = ["run_folder.py", "own_files.py", "archives.py", "demonstrations/export.py", "shards.py"]


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_a_folder_names_serves(tmp_path, says, breaks, mended):
    assert says in told(breaks, tmp_path) and mended(tmp_path)


def test_every_mend_that_an_error_about_a_folder_names_is_executed():
    assert not unsaid(CASES, *FILES)
