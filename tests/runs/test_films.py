"""Films: pictures and steps are of one episode, small, and the same for the same seed; where there are none, why."""

import io
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from PIL import Image

from irl_gym.agents.planners import SB3, ValueIteration
from irl_gym.features.bases import RadialBasis
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.loop import filming
from irl_gym.loop.loop import Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.films import load_film

QUICK = {"episodes": 5, "eval_episodes": 5}
pytestmark = pytest.mark.usefixtures("without_figures")


class Line(gym.Env):
    """Walk right to the end; draws when asked to, unless it is told to fail."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012 (as Gymnasium)
    observation_space, action_space = spaces.Discrete(90), spaces.Discrete(2)

    def __init__(self, render_mode=None, fails=False):
        self.render_mode, self.fails = render_mode, fails

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = 0
        return self.at, {}

    def step(self, action):
        self.at = min(max(self.at + (1 if action else -1), 0), 89)
        return self.at, float(self.at == 89), self.at == 89, False, {}

    def render(self):
        if self.fails:
            raise RuntimeError("no paint left")
        return np.full((600, 900, 3), self.at, dtype=np.uint8)


class Blind(Line):
    metadata = {"render_modes": []}  # noqa: RUF012


@pytest.fixture(scope="module", autouse=True)
def registered():
    for kind in (Line, Blind):
        gym.register(f"{kind.__name__}-v0", entry_point=kind, max_episode_steps=200)
    yield
    for kind in (Line, Blind):
        del gym.registry[f"{kind.__name__}-v0"]


def run(out, env_id, **changes):
    return recover_and_retrain(Experiment(env_id, 0.99, **{**QUICK, "retrain": ValueIteration(), **changes}), out)


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    return run(tmp_path_factory.mktemp("films") / "line", "Line-v0")


@pytest.fixture(scope="module")
def taxi(tmp_path_factory):
    return run(tmp_path_factory.mktemp("films") / "taxi", "Taxi-v4")


def test_a_film_has_a_moment_more_than_steps(line):
    film = load_film(line.out / "films" / "expert.json")
    assert len(film.steps) == 90 and film.ends == "terminated" and film.steps[0].action is None


def test_totals_are_sums_of_what_was_paid(line):
    film = load_film(line.out / "films" / "agent.json")
    paid = np.cumsum([one.learned_reward for one in film.steps[1:]])
    assert [one.learned_total for one in film.steps[1:]] == pytest.approx(paid) and film.steps[-1].true_total == 1.0


def test_a_picture_is_of_the_moment_that_names_it(line):
    film = load_film(line.out / "films" / "agent.json")
    pairs = [(one.state, film.frames[one.frame]) for one in film.steps if one.frame is not None]
    shown = [float(np.asarray(Image.open(io.BytesIO(picture))).mean()) for _, picture in pairs]
    assert np.abs(np.array(shown) - [state for state, _ in pairs]).max() < 4 and pairs[-1][0] == 89


def test_a_film_has_few_and_small_pictures(line):
    film = load_film(line.out / "films" / "agent.json")
    sizes = {Image.open(io.BytesIO(one)).size for one in film.frames}
    assert 30 <= len(film.frames) <= filming.MOST_FRAMES + 1 and sizes == {(320, 213)}


def test_films_of_a_run_stay_below_their_bound(taxi):
    assert sum(one.stat().st_size for one in (taxi.out / "films").rglob("*") if one.is_file()) < 1_500_000


def test_taxi_is_drawn(taxi):
    film = load_film(taxi.out / "films" / "expert.json")
    assert len(film.frames) > 5 and film.steps[0].text.startswith("taxi ")


def test_the_same_seed_makes_the_same_film(taxi, tmp_path):
    again = run(tmp_path / "again", "Taxi-v4")
    first, second = (
        {one.relative_to(made.out): one.read_bytes() for one in (made.out / "films").rglob("*") if one.is_file()}
        for made in (taxi, again)
    )
    assert first == second


def test_a_kind_of_pictures_that_leads_out_of_the_folder_is_refused(line, tmp_path):
    told = read_json(line.out / "films" / "agent.json")
    write_json(tmp_path / "agent.json", {**told, "kind": "/../../../secret"})
    with pytest.raises(ValueError, match="expected 'webp' or 'png'"):
        load_film(tmp_path / "agent.json")


@pytest.mark.parametrize(
    ("env_id", "kwargs", "why"),
    [("Blind-v0", {}, "draws no pictures"), ("Line-v0", {"fails": True}, "drawing failed: RuntimeError: no paint left")],
)
def test_a_film_without_pictures_says_why(tmp_path, env_id, kwargs, why):
    made = run(tmp_path, env_id, env_kwargs=kwargs)
    film = load_film(made.out / "films" / "agent.json")
    assert film.frames == () and why in film.without_frames and len(film.steps) == 90
    assert why in read_json(made.out / ".stages" / "record.json")["without_frames"]["agent"]


def test_an_environment_that_is_stepped_has_films(tmp_path):
    short = SB3(total_timesteps=256, hyperparameters={"n_steps": 64, "batch_size": 64})
    made = run(
        tmp_path,
        "CartPole-v1",
        learner=TrajectoryLP(
            RadialBasis.grid([-2.4, -3, -0.21, -3.5], [2.4, 3, 0.21, 3.5], 2), trajectories=20, horizon=20, max_rounds=1
        ),
        expert=short,
        inner=short,
        retrain=short,
        num_envs=2,
    )
    film = load_film(made.out / "films" / "agent.json")
    assert film.steps[0].state is None and len(film.frames) > 5 and film.steps[1].learned_reward is not None


# --- experts known by a dataset ---


def test_the_film_of_a_dataset_is_its_first_episode(line, tmp_path):
    data = {"dataset": "irl_gym/line-v0-expert-v0", "dataset_root": str(line.out / "dataset")}
    loop = Loop(Experiment(None, 0.99, **data, **QUICK, retrain=ValueIteration()), tmp_path)
    for stage in ("expert", "demonstrations", "reward"):
        loop.stage(stage)
    pays = partial(loop.world.pays, loop.learned)
    film = filming.film("expert", loop.env, loop.demonstrations[0], None, pays, loop.env_id)
    assert len(film.steps) == 90 and "does not say with which seed" in film.without_frames
