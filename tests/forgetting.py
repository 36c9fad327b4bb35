"""Runs whose files may be changed without a word: as versions left them that kept no digests, or with digests made anew."""

import json

from irl_gym.files.own_files import digest


def without_digests(run):
    """The folder of a run, from whose records the digests are gone."""
    for kept in (run / ".stages").glob("*.json"):
        record = json.loads(kept.read_text())
        record.pop("sha256", None)
        kept.write_text(json.dumps(record))
    return run


def with_digests_anew(run):
    """The folder of a run, whose records say of each file what it is now."""
    for kept in (run / ".stages").glob("*.json"):
        record = json.loads(kept.read_text())
        kept.write_text(json.dumps(record | {"sha256": {name: digest(run / name) for name in record["sha256"]}}))
    return run
