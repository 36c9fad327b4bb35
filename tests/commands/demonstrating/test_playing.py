"""The game without a screen, and the dataset that comes of it."""

import gymnasium as gym
import minari
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.commands.demonstrating.keyboard import controls_of
from irl_gym.commands.demonstrating.playing import Play, free_dataset, learn_command, stage, write_played
from irl_gym.errors import DatasetExists, InvalidParameter, NotDiscrete, UnknownEnvironment

LAKE = {"is_slippery": False}


class Corridor(gym.Env):
    """Five cells from -2; actions 3 and 4 go left and right. Shows a dict, whose arrays it goes on changing."""

    metadata = {"render_modes": ["ansi"]}  # noqa: RUF012
    action_space = spaces.Discrete(2, start=3)
    observation_space = spaces.Dict({"at": spaces.Box(-2, 2, (1,), np.int64)})
    render_mode = None

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = np.zeros(1, dtype=np.int64)
        return {"at": self.at}, {}

    def step(self, action):
        self.at += -1 if action == 3 else 1
        return {"at": self.at}, 1.0, bool(abs(self.at[0]) == 2), False, {}


def game(episodes=2, env_id="FrozenLake-v1", render_mode=None, **kwargs):
    settings = LAKE if env_id == "FrozenLake-v1" else {}
    env = gym.make(env_id, render_mode=render_mode, **settings)
    play = Play(env, controls_of(env), episodes, **kwargs)
    return play, play.start()


def press(play, keys):
    return [turn for key in keys for turn in play.press(key)]


def test_keys_become_an_episode():
    play, _ = game()
    press(play, "ddsssd")
    (episode,) = play.episodes
    assert episode.actions.tolist() == [2, 2, 1, 1, 1, 2] and episode.observations.tolist() == [0, 1, 2, 6, 10, 14, 15]
    assert episode.total_reward == 1 and episode.terminated and not episode.truncated


def test_the_end_of_an_episode_is_told_and_the_next_begins():
    play, _ = game()
    last, new = press(play, "ddsssd")[-2:]
    assert "Episode 1: return 1 in 6 steps, it ended." in last.said and new.said == "Episode 2 of 2 begins. Observation 0."


def test_the_game_is_over_after_the_last_episode():
    play, _ = game(1)
    press(play, "ddsssd")
    assert play.over and play.press("d") == [] and len(play.episodes) == 1


def test_frames_are_what_the_environment_renders():
    play, first = game(render_mode="ansi")
    assert isinstance(first.frame, str) and "(Right)" in play.press("d")[0].frame


def test_a_time_limit_truncates():
    env = gym.make("FrozenLake-v1", max_episode_steps=3, **LAKE)
    play = Play(env, controls_of(env), 1)
    play.start()
    assert "cut by the time limit" in press(play, "aaa")[-1].said and play.episodes[0].truncated


def test_again_discards_the_steps_and_takes_the_next_seed():
    play, _ = game()
    press(play, "dd")
    assert play.press("r")[0].said == "2 steps discarded. Episode 1 of 2 begins. Observation 0."
    press(play, "ddsssd")
    assert len(play.episodes[0]) == 6 and play.episodes[0].seed == 1


def test_attempts_have_seeds_of_their_own():
    play, _ = game(2, seed=10)
    press(play, "ddsssdrddsssd")
    assert [episode.seed for episode in play.episodes] == [10, 12]


def test_a_replayed_seed_gives_the_episode_that_was_played():
    env = gym.make("FrozenLake-v1")
    play = Play(env, controls_of(env), 1, seed=3)
    play.start()
    press(play, "dsaw" * 100)
    (episode,) = play.episodes
    env.reset(seed=3)
    assert [env.step(int(a))[0] for a in episode.actions] == episode.observations[1:].tolist()


def test_the_end_discards_an_unfinished_episode():
    play, _ = game()
    said = press(play, "ddq")[-1].said
    assert said == "The unfinished episode of 2 steps is discarded." and play.over and not play.episodes


def test_the_end_keeps_an_unfinished_episode_where_asked():
    play, _ = game(keep_unfinished=True)
    press(play, "dd")
    assert play.stop() == "The unfinished episode of 2 steps is kept, as truncated."
    assert play.episodes[0].truncated and not play.episodes[0].terminated and len(play.episodes[0]) == 2


def test_stopping_twice_keeps_an_episode_once():
    play, _ = game(keep_unfinished=True)
    press(play, "d")
    assert play.stop() and not play.stop() and len(play.episodes) == 1


def test_an_interruption_after_the_last_step_loses_nothing(monkeypatch):
    play, _ = game()
    press(play, "ddsss")

    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr(play, "_frame", interrupt)  # it is drawn before the episode is put down
    with pytest.raises(KeyboardInterrupt):
        play.press("d")
    play.stop()
    assert len(play.episodes) == 1 and play.episodes[0].terminated


def test_a_key_without_meaning_does_nothing():
    play, _ = game()
    assert play.press("x")[0].said == "'x' is no key here: ? shows them." and play.press("?")[0].said.startswith("Keys: left")


def test_actions_count_from_zero_and_observations_are_copied(tmp_path):
    env = Corridor()
    play = Play(env, controls_of(env), 1)
    play.start()
    press(play, "0111")
    assert play.episodes[0].actions.tolist() == [0, 1, 1, 1]
    assert play.episodes[0].observations["at"].ravel().tolist() == [0, -1, 0, 1, 2]
    kept = write_played(play, "corridor-v0", env, str(tmp_path))
    assert next(kept.iterate_episodes()).actions.tolist() == [3, 4, 4, 4]


def test_an_unfinished_game_of_blackjack_keeps_its_tuples():
    play, _ = game(env_id="Blackjack-v1", keep_unfinished=True)
    first = play.press("s")[0]
    assert "stick" in first.said and "Your sum" in first.said and len(play.episodes[0].observations) == 3


@pytest.mark.parametrize("settings", [{"n_episodes": 0}, {"n_episodes": 1, "seed": -1}])
def test_a_game_refuses_numbers_out_of_range(settings):
    env = gym.make("FrozenLake-v1")
    with pytest.raises(InvalidParameter, match=r"(episodes|seed) is (0|-1)"):
        Play(env, controls_of(env), **settings)


def test_a_stage_is_plain_for_the_dataset_and_rendered_for_the_player():
    plain, shown = stage("CliffWalking-v1", {}, "terminal")
    assert plain.render_mode is None and shown.render_mode == "ansi"


def test_a_stage_without_text_shows_pictures():
    assert stage("Blackjack-v1", {}, "terminal")[1].render_mode == "rgb_array"


@pytest.mark.parametrize(
    ("env_id", "kwargs", "error", "says"),
    [
        ("Pendulum-v1", {}, NotDiscrete, "expected Discrete"),
        ("Taxii-v4", {}, UnknownEnvironment, "The closest are"),
        ("FrozenLake-v1", {"render_mode": "human"}, InvalidParameter, "expected none. Choose with the mode"),
        ("enumeration_envs:Corridor-v0", {}, UnknownEnvironment, "expected an id"),
    ],
)
def test_a_stage_refuses_what_cannot_be_played(env_id, kwargs, error, says):
    with pytest.raises(error, match=says):
        stage(env_id, kwargs, "terminal")


@pytest.fixture
def corridor():
    gym.register("Corridor-v0", entry_point=Corridor)
    yield "Corridor-v0"
    gym.registry.pop("Corridor-v0")


def test_a_stage_refuses_what_renders_nothing_there(corridor):
    with pytest.raises(InvalidParameter, match=r"Corridor-v0 renders ansi: expected rgb_array or human for a window\. Play in"):
        stage(corridor, {}, "window")


def test_a_taken_id_is_refused_before_anybody_plays(tmp_path):
    play, _ = game(1)
    press(play, "ddsssd")
    write_played(play, "me/lake-v0", play.env, str(tmp_path))
    with pytest.raises(DatasetExists, match="me/lake-v0"):
        free_dataset("me/lake-v0", play.env, str(tmp_path))


def test_the_default_id_is_the_first_free_version(tmp_path):
    play, _ = game(1)
    press(play, "ddsssd")
    ids = []
    for _ in range(2):
        ids.append(free_dataset(None, play.env, str(tmp_path)))
        write_played(play, ids[-1], play.env, str(tmp_path))
    assert ids == ["irl_gym/frozenlake-v1-played-v0", "irl_gym/frozenlake-v1-played-v1"]


@pytest.mark.parametrize("dataset_id", ["bad", "a b/c-v0"])
def test_a_malformed_id_is_refused(tmp_path, dataset_id):
    with pytest.raises(InvalidParameter, match="malformed"):
        free_dataset(dataset_id, gym.make("FrozenLake-v1"), str(tmp_path))


@pytest.mark.parametrize(
    ("space", "says"),
    [
        (spaces.Graph(spaces.Discrete(2), None), "expected a space that Minari can keep"),
        (spaces.Box(0, 1, (3,)), "cannot be put together"),
    ],
)
def test_an_environment_that_cannot_be_kept_is_refused_before_anybody_plays(tmp_path, space, says):
    env = Corridor()
    env.observation_space = space
    with pytest.raises(InvalidParameter, match=says):
        free_dataset("corridor-v0", env, str(tmp_path))


def test_the_written_dataset_remembers_the_environment(tmp_path, monkeypatch):
    plain, shown = stage("FrozenLake-v1", LAKE, "terminal")
    play = Play(shown, controls_of(plain), 1)
    play.start()
    press(play, "ddsssd")
    write_played(play, "lake-v0", plain, str(tmp_path))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    assert minari.load_dataset("lake-v0").recover_environment().spec.kwargs == {"map_name": "4x4", "is_slippery": False}


def test_the_command_to_learn_quotes_what_needs_it():
    assert learn_command("me/lake-v0", "my data") == ("irl-gym run --dataset me/lake-v0 --dataset-root 'my data'")
