import itertools
from collections import defaultdict
from fractions import Fraction

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.toy_text.blackjack import BlackjackEnv, deck

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.reveal import Reveal
from irl_gym.errors import NotTabular
from irl_gym.judging.metrics import policy_value
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.tables.blackjack import HIT, STICK, blackjack_table, dealer_outcomes
from irl_gym.tables.selfcheck import compare_with_steps

UNDISCOUNTED = 0.999999
RULES = {"default": {"sab": False}, "natural": {"sab": False, "natural": True}, "sab": {"sab": True}}
CARDS = {card: Fraction(deck.count(card), 13) for card in range(1, 11)}


class Shoe:
    """Draws from the deck as NumPy's generator does, from a stock drawn beforehand: ten times as fast."""

    def __init__(self, seed):
        self.cards = self.stock(np.random.default_rng(seed))

    @staticmethod
    def stock(rng):
        while True:
            yield from rng.choice(deck, size=100_000).tolist()

    def choice(self, items):
        return next(self.cards) if items is deck else items[0]  # the other items are the suits that are painted


class Alone(gym.Env):
    """An environment with its wrapper inside, so that a copy of `unwrapped` still reveals."""

    def __init__(self, env):
        self.env, self.observation_space, self.action_space = env, env.observation_space, env.action_space

    def reset(self, **kwargs):
        return self.env.reset(**kwargs)

    def step(self, action):
        return self.env.step(action)


def made(rules, shown=True):
    env = gym.make("Blackjack-v1", **RULES[rules])
    return Reveal(env, {"natural": 2}) if shown else env


@pytest.fixture(scope="module")
def tables():
    """Tables of each rule, with naturals shown, and "bare" without."""
    found = {rules: blackjack_table(made(rules), UNDISCOUNTED) for rules in RULES}
    return found | {"bare": blackjack_table(made("default", shown=False), UNDISCOUNTED)}


def optimum(table):
    return policy_iteration(table.mdp, table.reward).policy


def played(rules, policy, states, hands, shoe):
    """Returns of hands of the real environment."""
    env = BlackjackEnv(**RULES[rules])
    if shoe:
        env.np_random = Shoe(0)
    elif hands:
        env.reset(seed=0)
    act = {
        (*seen["observation"], seen["natural"]): int(action)
        for seen, action in ((states.decode(row), policy[row]) for row in range(states.n_ordinary))
    }
    paid = np.empty(hands)
    for i in range(hands):
        observation, _ = env.reset()
        natural, ended = int(sorted(env.player) == [1, 10]), False
        while not ended:
            observation, paid[i], ended, _, _ = env.step(act[*observation, natural])
            natural = 0
    return paid


def off(paid, value):
    """Distance of the mean from a value in standard errors."""
    return abs(paid.mean() - value) / (paid.std(ddof=1) / np.sqrt(paid.size))


@pytest.mark.parametrize("rules", [*RULES, "bare"])
def test_blackjack_rows_are_distributions(tables, rules):
    mdp = tables[rules].mdp
    sums = mdp.P.sum(axis=1).reshape(mdp.n_states, 2)
    np.testing.assert_allclose(sums, np.where(mdp.terminal, 0.0, 1.0)[:, None].repeat(2, axis=1), atol=1e-14)


@pytest.mark.parametrize("rules", [*RULES, "bare"])
def test_blackjack_numbers_only_states_that_episodes_reach(tables, rules):
    assert tables[rules].mdp.reachable.all()


def test_blackjack_has_28_hands_for_each_card_shown_and_10_that_are_bust(tables):
    assert (tables["bare"].states.n_ordinary, len(tables["bare"].states.terminal_copies)) == (380, 280)


def test_blackjack_has_a_natural_more_for_each_card_where_it_is_shown(tables):
    assert (tables["sab"].states.n_ordinary, len(tables["sab"].states.terminal_copies)) == (390, 290)


def test_blackjack_begins_with_a_natural_against_an_ace_as_often_as_the_cards_say(tables):
    table = tables["sab"]
    row = table.states.encode({"observation": (21, 1, 1), "natural": 1})
    assert table.mdp.d0[row] == pytest.approx(2 * (1 / 13) * (4 / 13) / 13, abs=1e-15)


def test_blackjack_begins_with_exact_probabilities_that_sum_to_one(tables):
    assert tables["bare"].mdp.d0.sum() == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize("shown", [1, 6, 10])
def test_dealer_outcomes_equal_those_of_every_sequence_of_cards(shown):
    found = defaultdict(Fraction)

    def play(hand, p):
        ace = 1 in hand and sum(hand) + 10 <= 21
        score = sum(hand) + 10 * ace
        if len(hand) > 1 and score >= 17:
            found[score if score <= 21 else 0, sorted(hand) == [1, 10]] += p
            return
        for card in CARDS:
            play([*hand, card], p * CARDS[card])

    play([shown], Fraction(1))
    assert dealer_outcomes(shown, CARDS) == found


@pytest.mark.parametrize("shown", range(1, 11))
def test_dealer_outcomes_sum_to_one_exactly(shown):
    assert sum(dealer_outcomes(shown, CARDS).values()) == 1


def test_optimal_policy_equals_figure_5_2_of_sutton_and_barto(tables):
    table = tables["sab"]
    policy = optimum(table)
    for total, dealer, ace in itertools.product(range(4, 22), range(1, 11), (0, 1)):
        if ace and total < 12:
            continue
        if ace:
            sticks = total >= 19 or (total == 18 and dealer not in (9, 10, 1))
        else:
            sticks = total >= 17 or (total >= 13 and 2 <= dealer <= 6) or (total == 12 and dealer in (4, 5, 6))
        row = table.states.encode({"observation": (total, dealer, ace), "natural": 0})
        assert policy[row] == (STICK if sticks else HIT), (total, dealer, ace)


def test_optimal_policy_sticks_on_naturals(tables):
    table = tables["sab"]
    rows = [table.states.encode({"observation": (21, dealer, 1), "natural": 1}) for dealer in range(1, 11)]
    assert (optimum(table)[rows] == STICK).all()


@pytest.mark.parametrize("rules", RULES)
def test_optimal_value_equals_that_of_simulated_hands(tables, rules):
    table = tables[rules]
    policy = optimum(table)
    paid = played(rules, policy, table.states, 200_000, shoe=True)
    assert off(paid, policy_value(table.mdp, table.reward, policy)) < 3.5


@pytest.mark.slow
@pytest.mark.parametrize("rules", RULES)
def test_optimal_value_equals_that_of_a_million_hands_of_the_real_generator(tables, rules):
    table = tables[rules]
    policy = optimum(table)
    paid = played(rules, policy, table.states, 1_000_000, shoe=False)
    assert off(paid, policy_value(table.mdp, table.reward, policy)) < 3


def test_blackjack_is_worth_the_same_whether_or_not_naturals_are_shown_when_they_do_not_count(tables):
    bare, shown = (
        policy_iteration(tables[name].mdp, tables[name].reward).V @ tables[name].mdp.d0 for name in ("bare", "default")
    )
    assert bare == pytest.approx(shown, abs=1e-12)


def test_a_natural_that_wins_is_paid_half_as_much_again(tables):
    table = tables["natural"]
    row = table.states.encode({"observation": (21, 6, 1), "natural": 1})
    tied = sum(p for (score, _), p in dealer_outcomes(6, CARDS).items() if score == 21)
    assert table.reward.values[row, STICK] == pytest.approx(1.5 * (1 - float(tied)), abs=1e-12)


def test_a_natural_beats_a_drawn_21_under_sab(tables):
    row = tables["sab"].states.encode({"observation": (21, 6, 1), "natural": 1})
    assert tables["sab"].reward.values[row, STICK] == 1


@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("steps", [5_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_blackjack_agrees_with_steps_of_the_environment(tables, rules, steps):
    table = tables[rules]
    check = compare_with_steps(Alone(made(rules)), table.mdp, table.states, table.payments, steps=steps, seed=0)
    assert check.steps == steps


@pytest.mark.parametrize("steps", [5_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_bare_blackjack_agrees_with_steps_of_the_environment(tables, steps):
    table = tables["bare"]
    check = compare_with_steps(made("default", shown=False), table.mdp, table.states, table.payments, steps=steps, seed=0)
    assert check.rows_total == 560


@pytest.mark.parametrize(("rules", "named"), [("sab", "sab=True"), ("natural", "natural=True")])
def test_bare_blackjack_is_refused_where_naturals_pay_otherwise(rules, named):
    with pytest.raises(NotTabular, match=rf"{named}: .*\(21, 10, 1\).*Reveal\(env\)"):
        blackjack_table(made(rules, shown=False), 0.99)


def test_hands_that_the_refusal_names_are_paid_differently():
    env = BlackjackEnv(sab=True)
    env.reset(seed=0)
    paid = []
    for player in ([1, 10], [1, 2, 8]):
        env.dealer, env.player = [10, 2, 9], player
        paid.append(env.step(STICK)[:2])
    assert paid == [((21, 10, 1), 1.0), ((21, 10, 1), 0.0)]


def test_blackjack_table_is_none_for_other_environments():
    assert blackjack_table(gym.make("FrozenLake-v1"), 0.99) is None


def test_blackjack_table_is_none_for_a_subclass_with_rules_of_its_own():
    class Generous(BlackjackEnv):
        pass

    assert blackjack_table(Generous(), 0.99) is None


@pytest.mark.parametrize(
    "wrap",
    [
        lambda env: gym.wrappers.TransformReward(env, lambda r: 2 * r),
        lambda env: gym.wrappers.TransformObservation(env, lambda o: o[0], spaces.Discrete(32)),
        lambda env: Reveal(env, {"natural": 3}),
    ],
    ids=["reward", "observation", "another natural"],
)
def test_blackjack_table_is_none_where_a_wrapper_changes_something(wrap):
    assert blackjack_table(wrap(made("default", shown=False)), 0.99) is None


def test_blackjack_table_looks_through_a_learned_reward(tables):
    bare = made("default", shown=False)
    paid = LearnedReward(bare, np.zeros(tables["bare"].mdp.n_states), tables["bare"].states)
    assert (blackjack_table(paid, UNDISCOUNTED).mdp.P != tables["bare"].mdp.P).nnz == 0


def test_evidence_says_that_blackjack_is_exact(tables):
    evidence = tables["sab"].evidence
    assert (evidence.exact, evidence.split, "draws" in evidence.method) == (True, 290, True)
