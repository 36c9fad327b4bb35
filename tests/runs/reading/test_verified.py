"""What is said of an expert under a reward is computed from the files that lie there; what contradicts them is refused."""

import copy
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from forgetting import with_digests_anew
from lake_run import asked

from irl_gym.errors import RunIncomplete
from irl_gym.features.linear_reward import load_reward
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.policies import load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ExpectedAdvantage, ShapedReward
from irl_gym.runs.certificates import claims_in, facts_in
from irl_gym.runs.diagnosed import diagnose_run
from irl_gym.runs.reading.belonging import at_odds
from irl_gym.runs.reading.verified import again, claims, recomputed, shares, with_again
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied


@pytest.fixture(scope="module")
def run(finished):
    return read_run(finished)


def negated(path):
    one = load_reward(path / "reward.npz")
    TabularReward(-one.values, one.note).save(path / "reward.npz")


def rolled(path):
    np.savez(path / "expert.npz", actions=np.roll(load_actions(path / "expert.npz"), 1))


def discounted(path):
    with np.load(path / "table.npz") as archive:
        arrays = dict(archive)
    np.savez(path / "table.npz", **{**arrays, "gamma": np.array(0.5)})


@pytest.mark.parametrize(
    ("swap", "found"), [(negated, "as recorded"), (rolled, "as recorded"), (discounted, r"gamma 0\.5: expected 0\.99")]
)
def test_a_run_whose_files_do_not_bear_out_its_record_is_refused(unvouched, swap, found):
    swap(unvouched)
    with pytest.raises(RunIncomplete, match=f"table, expert and reward do not bear out its record: .*{found}"):
        read_run(unvouched)


def reshaped(path, reward=lambda one: one, paid=lambda one: one, clip=lambda one: one.clip):
    one = ShapedReward.load(path / "reward_shaped.npz")
    changed = (TabularReward(change(kind.values), kind.note) for kind, change in ((one.paid, paid), (one.learned, reward)))
    ShapedReward(*changed, clip(one)).save(path / "reward_shaped.npz")


@pytest.mark.parametrize(
    ("change", "found"),
    [({"reward": lambda R: R + 1}, "of another reward than reward.npz"), ({"paid": np.negative}, "the expected advantage"),
     ({"reward": lambda R: R[:-1], "paid": lambda R: R[:-1]}, "of another reward than reward.npz"),
     ({"clip": lambda one: one.clip * 2}, r"counts losses up to \S+: expected \S+, as the run has it")],
)  # fmt: skip
def test_a_shaped_reward_that_is_not_that_of_the_run_is_refused(unvouched, change, found):
    reshaped(unvouched, **change)
    with pytest.raises(RunIncomplete, match=found):
        read_run(unvouched)


@pytest.mark.parametrize("tau", [10.0, None])
def test_a_shaped_reward_whose_clip_is_not_the_runs_is_refused_though_it_is_an_expected_advantage(unvouched, run, tau):
    path = unvouched / "reward_shaped.npz"
    clip = None if tau is None else tau * ShapedReward.load(path).clip
    ShapedReward(ExpectedAdvantage(clip).apply(run.tabular, run.table.mdp), run.tabular, clip).save(path)
    with pytest.raises(RunIncomplete, match="counts losses up to"):
        read_run(unvouched)
    path.unlink()  # as the error says
    recover_and_retrain(asked(), unvouched)
    assert read_run(unvouched).recomputed


def test_a_run_of_an_earlier_version_has_no_shaped_reward(unvouched):
    (unvouched / "reward_shaped.npz").unlink()
    assert read_run(unvouched).recomputed


def test_a_run_with_a_swapped_file_is_made_whole_as_the_error_says(unvouched, finished):
    negated(unvouched)
    for name in ("table.npz", "expert.npz", "reward.npz"):
        (unvouched / name).unlink()
    recover_and_retrain(asked(), unvouched)
    assert read_run(unvouched).recomputed and np.array_equal(
        read_run(unvouched).learned.values, read_run(finished).learned.values
    )


def test_what_is_said_of_the_expert_is_computed_and_not_read(unvouched, run):
    for name, entry in (("metrics.json", "reward.expert_optimal"), ("certificate.json", "optimality.expert_optimal")):
        edited(unvouched / name, **{entry: False})
    assert read_run(unvouched).metrics["reward"] == run.metrics["reward"] and run.recomputed


def test_on_a_table_its_word_counts_more_than_that_of_episodes(finished, run):
    proof, negative = {"terms": {"expert_optimal": True}, "own": {}, "facts": []}, TabularReward(-run.tabular.values)
    found = recomputed(finished, run.config, {"optimality": None, "proof": proof}, run.table, run.expert, negative)
    assert found["facts"][0]["sentence"].startswith("no: the best policy earns at least")
    assert claims_in({"optimality": found, "proof": proof})["expert_optimal"] is False


def test_facts_of_the_reward_are_computed_and_not_read(copied, run):
    edited(copied / "certificate.json", **{"optimality.facts": [{"label": "tied", "sentence": "a lie", "mood": "good"}]})
    found = read_run(with_digests_anew(copied))
    assert facts_in(found.certificate)[0] == facts_in(run.certificate)[0] and "a lie" not in str(found.certificate)


def test_no_row_is_left_out_on_the_word_of_a_recorded_proof(copied, run):
    """A reward that ties every action in a state: who lists its rows as unbreakable hides no tie, and no margin is better."""
    mdp, tied = run.table.mdp, TabularReward(np.zeros_like(run.tabular.values))
    every = [[s, a] for s in range(mdp.n_states) for a in range(mdp.n_actions)]
    forged = {"terms": {"unbreakable_rows": every}, "own": {"unbreakable_rows": every}, "facts": []}
    plain = {"terms": {}, "own": {}, "facts": []}
    of_ties = [recomputed(copied, run.config, {"optimality": None, "proof": one}, run.table, run.expert, tied)
               for one in (forged, plain)]  # fmt: skip
    assert of_ties[0] == of_ties[1] and of_ties[0]["marginless"] and of_ties[0]["degenerate"]
    edited(copied / "certificate.json", **{"proof.terms.unbreakable_rows": every, "proof.own": {"unbreakable_rows": every}})
    found = read_run(with_digests_anew(copied))
    assert found.certificate["optimality"] == run.certificate["optimality"]
    assert supplied(diagnose_run, found).to_json() == supplied(diagnose_run, run).to_json()


@pytest.mark.parametrize(
    ("entry", "value", "why"),
    [
        ("proof.facts", "all is well", "facts are 'all is well': expected a list"),
        ("proof.terms.unbreakable_rows", [[99]], "proof.terms.unbreakable_rows.0 is "),
        ("optimality", 7, "optimality is 7: expected an object"),
    ],
)
def test_a_certificate_that_is_none_is_refused_and_the_mend_works(finished, unvouched, entry, value, why):
    edited(unvouched / "certificate.json", **{entry: value})
    with pytest.raises(RunIncomplete, match=why):
        read_run(unvouched)
    (unvouched / "certificate.json").unlink()
    recover_and_retrain(asked(), unvouched)
    assert read_run(unvouched).certificate == read_run(finished).certificate


def test_metrics_that_hide_the_reward_are_refused_and_made_again(finished, unvouched):
    told = read_json(unvouched / "metrics.json")
    told["policies"]["learned"] = told["policies"].pop("retrained")
    write_json(unvouched / "metrics.json", told)
    with pytest.raises(RunIncomplete, match=r"whether a reward was learned; delete metrics\.json, and it is made again"):
        read_run(unvouched)
    (unvouched / "metrics.json").unlink()
    recover_and_retrain(asked(), unvouched)
    assert read_run(unvouched).metrics == read_run(finished).metrics


def test_metrics_that_hide_the_clone_are_refused(unvouched):
    told = read_json(unvouched / "metrics.json")
    del told["policies"]["clone"]
    write_json(unvouched / "metrics.json", told)
    with pytest.raises(RunIncomplete, match=r"whether there is a clone; delete metrics\.json, and it is made again"):
        read_run(unvouched)


def test_metrics_that_hide_the_table_are_refused(unvouched):
    write_json(unvouched / "metrics.json", {**read_json(unvouched / "metrics.json"), "table": None})
    with pytest.raises(RunIncomplete, match=r"tells of no table, and table\.npz is there; delete metrics\.json"):
        read_run(unvouched)


@pytest.mark.parametrize(("judged", "faults"), [({"expert_optimal": True}, 1), (None, 0)])
def test_a_verdict_that_only_a_table_gives_is_refused_where_there_is_none(judged, faults):
    stages = {"reward": {"files": ["reward.npz"], "policy": False}}
    found = [*at_odds(stages, {"policies": {"retrained": {}}, "table": None}, {"optimality": judged}, {"reward.npz"})]
    assert len(found) == faults and all("which only a table tells" in one for one in found)


def test_values_by_episodes_are_said_to_be_the_record_s(run):
    policies = {**run.metrics["policies"], "expert": run.metrics["policies"]["expert"] | {"sampled_value": 1.0}}
    told = replace(run, metrics={**run.metrics, "policies": policies})
    assert told.whose == run.whose.removesuffix(".") + ", and among it values by episodes."


# --- digests that were made anew ---


def edited(path, **changes):
    """A json file in which some entries, by their dotted names, are others."""
    content = read_json(path)
    for name, value in changes.items():
        *where, last = name.split(".")
        reduce(dict.__getitem__, where, content)[last] = value
    write_json(path, content)


EDITS = {
    "metrics.json": {
        "reward.learner": ("Theirs", "config.json"), "demonstrations.given": (True, "config.json"),
        "reward.status": ("inaccurate", r"\.stages/reward\.json"),
        "demonstrations.episodes": (7, r"\.stages/demonstrations\.json"),
        "reward.degenerate": (True, r"certificate\.json"), "reward.violated_states": (3, r"certificate\.json"),
        "table.exact": (False, r"table\.npz"), "table.states": (17, r"table\.npz"), "table.horizon": (3, r"table\.npz"),
        "policies.random.value": (0.0, r"table\.npz"), "policies.expert.value": (2.0, r"expert\.npz"),
        "policies.retrained.value": (0.9, r"agent_policy\.npz"), "policies.clone.value": (0.9, r"clone_policy\.npz"),
        "policies.clone.how": ("by hand", r"\.stages/clone\.json"),
    },
    "certificate.json": {
        "proof.terms.duality_gap": (0.5, r"certificate\.json"), "optimality.zero": (True, r"certificate\.json"),
    },
    "config.json": {"learner.type": ("FeatureLP", r"config\.json"), "epsilon": (0.1, r"config\.json")},
}  # fmt: skip


@pytest.mark.parametrize(("name", "entry"), [(name, entry) for name, entries in EDITS.items() for entry in entries])
def test_an_entry_that_other_files_contradict_is_named_with_them(copied, name, entry):
    value, source = EDITS[name][entry]
    edited(copied / name, **{entry: value})
    with pytest.raises(RunIncomplete, match=rf"metrics\.json has \S+ .*: expected .*, as {source} gives it; delete "):
        read_run(with_digests_anew(copied))


@pytest.mark.parametrize(
    ("name", "entry", "value", "gone"),
    [
        ("metrics.json", "reward.status", "inaccurate", ["metrics.json"]),
        ("certificate.json", "proof.terms.objective", 7.0, ["certificate.json", "metrics.json"]),
        ("environment.json", "id", "Theirs-v0", ["environment.json"]),
    ],
)
def test_what_was_edited_is_refused_by_who_reads_and_who_continues_and_the_mend_works(
    finished, copied, name, entry, value, gone
):
    edited(copied / name, **{entry: value})
    with_digests_anew(copied)
    for read in (read_run, lambda path: recover_and_retrain(asked(), path)):
        with pytest.raises(RunIncomplete, match=f"delete {' and '.join(gone)}, and .* again"):
            read(copied)
    for one in gone:
        (copied / one).unlink()
    recover_and_retrain(asked(), copied)
    assert read_run(copied).vouched and (copied / name).read_bytes() == (finished / name).read_bytes()


@pytest.mark.parametrize(("name", "file"), [("retrained", "agent_policy.npz"), ("clone", "clone_policy.npz")])
def test_a_policy_that_was_swapped_is_named_and_made_again(copied, run, name, file):
    other = 0 if run.metrics["policies"][name]["value"] else run.expert  # of another value
    np.savez(copied / file, actions=np.zeros_like(run.expert) + other)
    with pytest.raises(RunIncomplete, match=rf"as {file} gives it; delete {file} and metrics\.json, and"):
        read_run(with_digests_anew(copied))
    for one in (file, "metrics.json"):
        (copied / one).unlink()
    recover_and_retrain(asked(), copied)
    assert np.array_equal(read_run(copied).agents[name], run.agents[name])


RECORDED = {"mean_return", "return_low", "return_high"}
"""Of metrics.json, what is sampled: the page says that it is the run's own record."""


def leaves(content, where=""):
    """The dotted names of what a json object holds."""
    for key, value in content.items():
        yield from leaves(value, f"{where}{key}.") if isinstance(value, dict) else [f"{where}{key}"]


@pytest.mark.parametrize("kind", ["reward", "policy", "both"])
def test_each_entry_is_compared_or_computed_or_known_to_be_a_record(finished, policy_run, kind):
    path = finished if kind == "reward" else policy_run(kind)
    told, run = read_json(path / "metrics.json"), read_run(path)
    parts = run.config, run.stages, run.certificate, told, run.table
    claimed, now = again(run.config, told, run.table, run.expert, run.agents, run.tabular, run.curve)
    checked, left = [*claims(*parts), *claimed], set()
    now["policies"] = {name: now["policies"][name] | one for name, one in shares(told["policies"]).items()}
    assert with_again(told, now) == told == {**run.metrics, "reward": told["reward"]}
    for name in leaves(told):
        other = copy.deepcopy(told)
        *where, last = name.split(".") if "steps_to_" not in name else name.split(".", 1)
        reduce(dict.__getitem__, where, other)[last] = "another"
        if not any(one.fault(other) for one in checked) and with_again(other, now) != told:
            left.add(name)
    assert left == {f"policies.{name}.{key}" for name in told["policies"] for key in RECORDED}


def test_a_horizon_without_an_end_leaves_the_values_to_the_record(run):
    metrics = {**run.metrics, "table": {**run.metrics["table"], "horizon": 10**9}}
    assert again(run.config, metrics, run.table, run.expert, run.agents, run.tabular, run.curve) is None
    assert replace(run, recomputed=False, judged_again=False).whose == "Everything is the run's own record."


def test_a_page_says_what_was_computed_again_and_that_all_else_is_a_record(finished, run):
    assert "values, scores and agreement" in run.whose and run.whose.endswith("All else is the run's own record.")
    assert run.whose.replace("'", "&#39;") in (finished / "report.html").read_text()
