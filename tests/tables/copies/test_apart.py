"""What deepcopy leaves as it is leads a copy of an environment back to it: made anew, or refused."""

import types
import weakref

import pytest
from apart_envs import (
    BOARD,
    Boarded,
    Line,
    N,
    OfBase,
    OfComprehension,
    OfFunction,
    OfProperty,
    WithBoard,
    a_dictionary_of_its_own_attributes,
    a_method_behind_a_function,
    a_view_that_copies_itself,
    a_weak_reference_that_a_step_makes,
    a_weak_reference_that_reset_makes,
    a_weak_reference_to_itself,
    attributes_beside_their_object,
    attributes_of_two,
    beside_what_has_no_pickle,
    closes_over_a_list,
    closes_over_a_list_of_lists,
    closes_over_a_lock,
    closes_over_an_attribute_alone,
    closes_over_an_attribute_that_stays,
    closes_over_self,
    default,
    functions_of_functions,
    its_own_attributes,
    large,
    logs,
    made_anew_by_reset,
    of_a_function_that_is_held,
    of_the_class,
    of_the_module,
    reads_a_list_that_stays,
    sets_a_variable,
    shared_memory,
    weakly,
)

from irl_gym.errors import NotTabular
from irl_gym.tables.copies.stripped import without_watchers
from irl_gym.tables.enumeration.table import Enumeration

JOINED = (a_dictionary_of_its_own_attributes, attributes_beside_their_object)


@pytest.mark.parametrize(
    "give",
    [
        closes_over_self,
        default,
        functions_of_functions,
        a_method_behind_a_function,
        reads_a_list_that_stays,
        closes_over_an_attribute_that_stays,
        closes_over_an_attribute_alone,
        logs,
        closes_over_a_lock,
        a_weak_reference_to_itself,
        beside_what_has_no_pickle(a_weak_reference_to_itself),
        a_weak_reference_that_reset_makes,
        *JOINED,
        *(change(give) for give in JOINED for change in (large, made_anew_by_reset, beside_what_has_no_pickle)),
    ],
)
def test_a_function_that_holds_the_environment_holds_its_copy_in_a_copy(give):
    env = Line(give)
    table = Enumeration().table(env, 0.9)
    P = table.mdp.P.toarray().reshape(N, 2, N)[: N - 1].argmax(-1)
    assert (P.tolist(), table.evidence.exact) == ([[max(s - 1, 0), s + 1] for s in range(N - 1)], True)
    assert env.at == 0  # its own was not moved


REFUSED = {
    "a list of a closure's": (Line, closes_over_a_list, "changes what the function .* holds .box., which all"),
    "a list in a list of a closure's": (Line, closes_over_a_list_of_lists, "Line.put leads to a list"),
    "a weak reference": (Line, weakly(weakref.ref, lambda ref: ref()), "Line.weak leads to a One"),
    "a weak reference that a step makes": (Line, a_weak_reference_that_a_step_makes, "a state leads to a One"),
    "a weak proxy": (Line, weakly(weakref.proxy, lambda one: one), "Line.weak leads to a "),
    "a weak dict": (Line, weakly(lambda one: weakref.WeakValueDictionary({0: one}), lambda held: held[0]), "leads to a One"),
    "a view that copies itself": (Line, a_view_that_copies_itself, "share memory"),
    "a variable that is set": (Line, sets_a_variable, "changes what the function .*put holds .at., which all copies share"),
    "its own attributes": (Line, its_own_attributes, "whose __dict__ is held in another way too"),
    "attributes of two objects": (Line, attributes_of_two, "leads to a One whose __dict__ is held in another way too"),
    "memory that processes share": (Line, shared_memory, "Line.memory leads to a SharedMemory"),
    "a variable that is set beside what has no pickle": (
        Line,
        beside_what_has_no_pickle(sets_a_variable),
        "changes what the function .*put holds .at.",
    ),
    "a module's": (WithBoard, of_the_module, "changes .*apart_envs.BOARD, which all copies share"),
    "a class's": (WithBoard, of_the_class, "changes WithBoard.board, which all copies share"),
    "a base class's": (OfBase, of_the_class, "changes Boarded.board, which all copies share"),
    "a module's, of a property": (OfProperty, of_the_module, "changes .*apart_envs.BOARD, which all copies share"),
    "a module's, of a function": (OfFunction, of_the_module, "changes .*apart_envs.BOARD, which all copies share"),
    "a module's, of a comprehension": (OfComprehension, of_the_module, "changes .*apart_envs.BOARD, which all copies share"),
    "a module's, of what is held": (Line, of_a_function_that_is_held, "changes .*apart_envs.BOARD, which all copies share"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_copies_share_is_refused_where_it_changes(name):
    kind, give, what = REFUSED[name]
    BOARD[0] = WithBoard.board[0] = Boarded.board[0] = 0
    with pytest.raises(NotTabular, match=what):
        Enumeration().table(kind(give), 0.9)


class Told(Line):
    def get_state(self):
        return self.see()

    def set_state(self, state):
        self.put(state)


def test_get_state_and_set_state_mend_what_leads_back():
    table = Enumeration().table(Told(closes_over_a_list_of_lists), 0.9)
    assert (table.mdp.n_states, table.evidence.exact) == (N, True)


def test_a_global_that_stays_is_shared_and_no_obstacle():
    BOARD[0] = WithBoard.board[0] = 0
    env = WithBoard(lambda env: setattr(env, "mine", BOARD))
    env.see = types.MethodType(lambda self: self.at + self.mine[0], env)
    assert Enumeration().table(env, 0.9).mdp.n_states == N


def test_functions_that_share_a_variable_share_it_in_a_copy():
    def give(env):
        count = 0

        def put(place):
            nonlocal count
            count += 1
            env.at = place

        env.put, env.counted = put, lambda: (env, count)

    env = Line(give)
    made = without_watchers(env)
    made.put(3)
    assert (made.counted()[1], env.counted()[1], made.at, env.at) == (1, 0, 3, 0)
