"""Blackjack-v1 as an exact table: Gymnasium publishes no P for it, but its cards are known.

The deck has 13 cards, drawn with replacement; an ace counts 11 while that does not bust the hand. A hand is (hard total,
usable ace): its aces at 1, and whether 10 may be added; an ace once counted as 1 never counts as 11 again, so a card leads
from a hand to a hand and nothing else of it matters. The dealer's hidden card and later ones are independent of all that is
seen, so what sticking pays is a sum over the dealer's finished hands, found by a programme over hands of growing hard total.

Sticking leaves the observation as it is and ends the episode, so each state has a terminal copy; going bust ends in a sum of
22 to 31. A *natural*, an ace and a ten as the first two cards, beats a drawn 21 under `sab` and is paid 1.5 under `natural`.
The observation does not show it, so under these rules it has to: `irl_gym.environments.reveal.Reveal` adds it.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.toy_text import blackjack

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.reveal import layers
from irl_gym.environments.watching_wrappers import only_watches
from irl_gym.errors import NotTabular
from irl_gym.spaces.listed_states import ListedStates, in_order
from irl_gym.tables.tabulation import Evidence, Lines, Tabulation, from_lines

STICK, HIT = 0, 1
DEALER_STICKS = 17
MOST = 21
NATURAL = {1, 10}
"""The two cards of a natural."""

Hand = tuple[int, bool]
"""Hard total, and whether an ace counts 11."""
Cards = dict[int, Fraction]
"""Card -> its probability."""


def blackjack_table(env: gym.Env, gamma: float) -> Tabulation | None:
    """The exact table of Gymnasium's Blackjack-v1, from its deck.

    Args:
        env: the environment, as it is or with its naturals shown: observations {"observation": ..., "natural": 0 or 1}.
        gamma: discount in (0, 1); 0.999999 for the undiscounted game.

    Returns:
        None where the environment is another one, or wrapped in something that changes it otherwise.

    Raises:
        NotTabular: `sab` or `natural`, and the observation does not show which 21 is a natural.
    """
    base = env.unwrapped
    if type(base) is not blackjack.BlackjackEnv:
        return None
    shown = _shows_naturals(env)
    if shown is None:
        return None
    rules = _Rules(bool(base.natural), bool(base.sab))
    if rules.tell_naturals and not shown:
        raise NotTabular(
            f"Blackjack with {rules}: the hands (ace, 10), a natural, and (ace, 2, 8) are one observation, such as "
            "(21, 10, 1), and sticking pays them differently: expected an observation that shows which it is. Wrap it, "
            "as in `irl_gym.environments.reveal.Reveal(env)`."
        )
    cards = {card: Fraction(count, len(blackjack.deck)) for card, count in Counter(blackjack.deck).items()}
    return _assemble(_Game(cards, rules, shown), env.observation_space, gamma)


@dataclass(frozen=True)
class _Rules:
    """The environment's arguments."""

    natural: bool
    sab: bool

    @property
    def tell_naturals(self) -> bool:
        """Does a natural pay otherwise than a drawn 21?"""
        return self.natural or self.sab

    def __str__(self) -> str:
        return "sab=True" if self.sab else f"natural={self.natural}"

    def paid(self, player: int, player_natural: bool, dealer: int, dealer_natural: bool) -> float:
        """What sticking pays, by the scores of both hands; a bust scores 0."""
        if self.sab and player_natural and not dealer_natural:
            return 1.0
        won = float(player > dealer) - float(player < dealer)
        return 1.5 if self.natural and not self.sab and player_natural and won == 1 else won


@dataclass(frozen=True)
class _State:
    """What the player sees, and whether the hand is a natural; False where that is not shown."""

    hand: Hand
    dealer: int
    natural: bool

    def after(self, card: int) -> "_State":
        """The state one card later."""
        return _State(after(self.hand, card), self.dealer, False)

    @property
    def bust(self) -> bool:
        """Is the hand over?"""
        return total(self.hand) > MOST

    def numbers(self, space: spaces.Space) -> list[int]:
        """The observation, flattened in the order of the space."""
        seen = [total(self.hand), self.dealer, int(self.hand[1])]
        if not isinstance(space, spaces.Dict):
            return seen
        parts = {"natural": [int(self.natural)], "observation": seen}
        return [number for key in space.spaces for number in parts[key]]


@dataclass(frozen=True)
class _Game:
    """The rules of the draws."""

    cards: Cards
    rules: _Rules
    shown: bool

    def starts(self) -> dict[_State, Fraction]:
        """First states: two cards for the player, one of the dealer's shown."""
        found: dict[_State, Fraction] = defaultdict(Fraction)
        for first, p in self.cards.items():
            for second, q in self.cards.items():
                natural = self.shown and {first, second} == NATURAL
                for dealer, r in self.cards.items():
                    found[_State(hand_of((first, second)), dealer, natural)] += p * q * r
        return dict(found)

    def states(self) -> list[_State]:
        """All that follow from the first ones, those that are bust included."""
        found = dict.fromkeys(self.starts())
        frontier = list(found)
        while frontier:
            state = frontier.pop()
            following = [] if state.bust else [state.after(card) for card in self.cards]
            frontier.extend(new for new in dict.fromkeys(following) if new not in found)
            found.update(dict.fromkeys(following))
        return list(found)

    def stick(self, state: _State, outcomes: dict[tuple[int, bool], Fraction]) -> dict[float, Fraction]:
        """What sticking pays -> its probability, by the dealer's finished hands."""
        paid: dict[float, Fraction] = defaultdict(Fraction)
        for finished, p in outcomes.items():
            paid[self.rules.paid(total(state.hand), state.natural, *finished)] += p
        return paid


def after(hand: Hand, card: int) -> Hand:
    """A hand one card later."""
    hard = hand[0] + card
    return hard, (hand[1] or card == 1) and hard + 10 <= MOST


def hand_of(cards: Iterable[int]) -> Hand:
    """The hand of some cards."""
    hand: Hand = (0, False)
    for card in cards:
        hand = after(hand, card)
    return hand


def total(hand: Hand) -> int:
    """What a hand counts."""
    return hand[0] + 10 * hand[1]


def dealer_outcomes(shown: int, cards: Cards) -> dict[tuple[int, bool], Fraction]:
    """Probabilities of the dealer's finished hands, as (score, natural), by the card shown; a bust scores 0."""
    going: dict[tuple[Hand, bool], Fraction] = defaultdict(Fraction)
    for card, p in cards.items():
        going[hand_of((shown, card)), {shown, card} == NATURAL] += p
    finished: dict[tuple[int, bool], Fraction] = defaultdict(Fraction)
    while going:
        hand, natural = least = min(going)  # of the lowest hard total: no other hand can still lead to it
        p = going.pop(least)
        if total(hand) >= DEALER_STICKS:
            finished[total(hand) if total(hand) <= MOST else 0, natural] += p
            continue
        for card, q in cards.items():
            going[after(hand, card), False] += p * q
    return dict(finished)


def _shows_naturals(env: gym.Env) -> bool | None:
    """Does the observation show whether the hand is a natural? None where a wrapper changes something else."""
    plain, shown = env.unwrapped.observation_space, False
    flagged = spaces.Dict({"observation": plain, "natural": spaces.Discrete(2)})
    for wrapper in layers(env):
        if not isinstance(wrapper, gym.Wrapper):
            break
        if wrapper.observation_space == flagged and wrapper.env.observation_space == plain:
            shown = True
        # LearnedReward changes only the reward, which `tabulate` takes from it.
        elif not (only_watches(wrapper) or isinstance(wrapper, LearnedReward)):
            return None
    return shown if env.observation_space == (flagged if shown else plain) else None


def _assemble(game: _Game, space: spaces.Space, gamma: float) -> Tabulation:
    """Rows for all states, and a terminal copy of each that can be stuck on."""
    found = game.states()
    numbers = np.array([state.numbers(space) for state in found])
    order = in_order(numbers)
    ordered = [found[i] for i in order]
    row = {state: i for i, state in enumerate(ordered)}
    playing = [state for state in ordered if not state.bust]
    copies = {row[state]: len(ordered) + i for i, state in enumerate(playing)}
    states = ListedStates(space, numbers[order], copies)
    d0 = np.zeros(states.n_states)
    for state, p in game.starts().items():
        d0[row[state]] = p
    outcomes = {card: dealer_outcomes(card, game.cards) for card in game.cards}
    lines: list[tuple[int, int, Fraction, float]] = []  # row of P, successor, probability, reward
    for state in playing:
        s = row[state]
        lines.extend((2 * s + STICK, copies[s], p, paid) for paid, p in game.stick(state, outcomes[state.dealer]).items())
        for card, p in game.cards.items():
            following = state.after(card)
            lines.append((2 * s + HIT, row[following], p, -1.0 if following.bust else 0.0))
    rows, successors, p, paid = zip(*lines, strict=True)
    evidence = Evidence(
        "Enumeration of the draws: 13 cards with replacement, and the dealer's finished hands for each card shown.",
        exact=True, merged=0, split=len(copies), check=None,
    )  # fmt: skip
    columns = Lines(np.array(rows), np.array(successors), np.array(p, dtype=np.float64), np.array(paid))
    return from_lines(columns, d0, 2, states, gamma=gamma, evidence=evidence)
