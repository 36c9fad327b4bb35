"""Runs as versions left them that kept no digests: their files may be changed without a word."""

import json


def without_digests(run):
    """The folder of a run, from whose records the digests are gone."""
    for kept in (run / ".stages").glob("*.json"):
        record = json.loads(kept.read_text())
        record.pop("sha256", None)
        kept.write_text(json.dumps(record))
    return run
