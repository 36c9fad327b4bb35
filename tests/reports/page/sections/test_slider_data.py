import numpy as np
import pytest
from reports.page.made_runs import scene_of, section_of, table_run

from irl_gym.judging.metrics import optimal_actions
from irl_gym.reports.page.sections.slider import Pieces, greedy_sets, lambda_slider


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("run"), films=False)


@pytest.fixture(scope="module")
def scene(run):
    return scene_of(run)


def slider_of(run, **changes):
    """The section, and what its script shows, of a path that was changed."""
    section = section_of(lambda_slider, run, lambda_path={**run.lambda_path, **changes})
    return section, section.script["slider"]


def test_greedy_sets_are_the_optimal_actions(run, scene):
    rewards = run.lambda_path["rewards"]
    for values, found in zip(rewards, greedy_sets(scene, rewards), strict=True):
        np.testing.assert_array_equal(found[scene.acting], optimal_actions(scene.mdp, values)[scene.acting])


def test_greedy_sets_are_the_optimal_actions_where_the_expert_is_none(run, scene):
    values = -run.lambda_path["rewards"][:1]
    (found,) = greedy_sets(scene, values)
    np.testing.assert_array_equal(found[scene.acting], optimal_actions(scene.mdp, values[0])[scene.acting])


def test_the_last_piece_is_no_reward(run):
    pieces = Pieces.of_path(run.lambda_path, 100)
    assert not pieces.rewards[-1].any() and np.isinf(pieces.high[-1]) and pieces.l1_norms[-1] == 0


def test_pieces_that_are_left_out_leave_no_gap(run):
    pieces = Pieces.of_path(run.lambda_path, 3)
    np.testing.assert_array_equal(pieces.high[:-1], pieces.low[1:])
    assert len(pieces.low) == 4 and pieces.low[0] == 0 and pieces.of == 6


def test_each_position_has_its_words_and_pictures(run):
    section, data = slider_of(run)
    assert section.kind == "lambda"
    assert {len(one["values"]) for one in data["figures"].values()} == {len(data["pieces"])} == {7}
    assert all(piece["change"].startswith("At price") for piece in data["pieces"])


@pytest.mark.parametrize("exact", [True, False])
def test_a_path_that_is_not_whole_says_how_much_may_be_missing(run, exact):
    lead = slider_of(run, exact=np.array(exact), gap=np.array(0.0125))[0].lead
    assert ("There are more pieces" in lead and "0.013 larger" in lead) != exact


def test_a_path_that_is_not_certified_says_by_how_much(run):
    lead = slider_of(run, exact=np.array(False), whole=np.array(True), gap=np.array(0.3))[0].lead
    assert "not certified" in lead and "0.3 above it" in lead and "There are more pieces" not in lead


def test_a_faint_piece_has_colours_of_its_own_and_says_so(run):
    rewards = run.lambda_path["rewards"].copy()
    rewards[-1] = 0.0
    rewards[-1, 14] = 0.01 * np.abs(rewards).max()
    _, data = slider_of(run, rewards=rewards)
    *others, faint, none = data["figures"]["path-reward"]["ends"]
    assert faint == pytest.approx([-rewards[-1, 14], rewards[-1, 14]]) and all(one == none for one in others)
    assert [piece["colours"] for piece in data["pieces"]] == ["all pieces"] * 5 + ["this piece", "all pieces"]


def test_what_is_counted_as_no_reward_is_drawn_as_0(run):
    rewards = run.lambda_path["rewards"].copy()
    rewards[0, 1] = 1e-12 * np.abs(rewards[0]).max()
    _, data = slider_of(run, rewards=rewards)
    drawn = [one for row in data["figures"]["path-reward"]["values"][0] for one in row if one]
    assert f"{len(drawn)}" == data["pieces"][0]["paid"] and len(drawn) == (np.abs(rewards[0]) > 1e-6).sum()


def test_several_states_are_told_with_commas_and_one_and(run):
    rewards = np.zeros_like(run.lambda_path["rewards"])
    rewards[0, [1, 2, 3]] = 0.5
    _, data = slider_of(run, rewards=rewards)
    told = "the reward of (row 0, column 1), (row 0, column 2) and (row 0, column 3) becomes 0; "
    assert told in data["pieces"][1]["change"]


def test_what_changes_is_worked_out_from_the_rewards_and_no_sentence_of_the_file(run):
    _, data = slider_of(run, changes=[{"sentence": "FORGED"}] * 7)
    assert all(piece["change"].startswith("At price") for piece in data["pieces"])


def test_the_slider_starts_at_the_run_s_own_price(tmp_path):
    found = table_run(tmp_path, l1=0.5, films=False)
    ends, (_, data) = found.lambda_path["breakpoints"], slider_of(found)
    assert ends[data["start"]] < 0.5 <= ends[data["start"] + 1]
