"""Callers take turns, whatever each of them asks for."""

import pytest

from sketchmatch.app.waiting import Caller, FairQueue


def filled(**waiting):
    """Return a queue, with a string of items for each caller; after ``_`` comes a connection."""
    queue = FairQueue()
    for who, items in waiting.items():
        name, _, connection = who.partition("_")
        for item in items:
            queue.add(f"{name}{connection}{item}", Caller(name, connection))
    return queue


def emptied(queue):
    items = []
    while (item := queue.take()) is not None:
        items.append(item)
    return items


@pytest.mark.parametrize(
    ("waiting", "order"),
    [
        ({}, []),
        ({"a": "123"}, ["a1", "a2", "a3"]),
        ({"a": "1234", "b": "12"}, ["a1", "b1", "a2", "b2", "a3", "a4"]),
        ({"a_x": "12", "a_y": "12", "b": "12"}, ["ax1", "b1", "ay1", "b2", "ax2", "ay2"]),
    ],
)
def test_callers_take_turns_and_so_do_the_connections_of_each(waiting, order):
    queue = filled(**waiting)
    assert len(queue) == len(order)
    assert emptied(queue) == order
    assert len(queue) == 0


def test_whoever_asks_again_and_again_comes_after_one_who_waits():
    queue = filled(a="12345")
    assert queue.take() == "a1"
    queue.add("b1", Caller("b"))
    queue.add("a6", Caller("a"))
    assert [queue.take(), queue.take()] == ["a2", "b1"]


def test_what_does_not_fit_keeps_its_place_and_holds_nobody_up():
    queue = filled(a="123", b="1")
    assert queue.take(lambda item: item == "a2") == "a2"
    assert queue.take(lambda _: False) is None
    assert emptied(queue) == ["b1", "a1", "a3"]


def test_an_item_is_taken_out_once():
    queue = filled(a="12")
    assert queue.remove("a1", Caller("a"))
    assert not queue.remove("a1", Caller("a"))
    assert not queue.remove("c1", Caller("c"))
    assert emptied(queue) == ["a2"]


@pytest.mark.parametrize(
    ("waiting", "newcomer", "out"),
    [
        ({"a": "123", "b": "1"}, Caller("b"), "a3"),
        ({"a": "123", "b": "1"}, Caller("a"), "a3"),
        ({"a": "12", "b": "12"}, Caller("b"), "b2"),
        ({"a": "12", "b": "12"}, Caller("a"), "a2"),
        ({"a_x": "12", "a_y": "1", "b": "12"}, Caller("b"), "ax2"),
        ({"a_x": "1", "a_y": "1", "a_z": "1"}, Caller("a", "y"), "ay1"),
    ],
)
def test_when_it_is_full_the_last_of_whoever_has_most_goes(waiting, newcomer, out):
    queue = filled(**waiting)
    item, caller = queue.crowd_out(newcomer)
    assert item == out
    assert item.startswith(f"{caller.name}{caller.connection}")
    assert out not in emptied(queue)


@pytest.mark.parametrize(
    ("waiting", "newcomer", "out"),
    [
        ({"a": "111", "b": "4"}, Caller("a"), "b4"),
        ({"a": "13", "b": "4"}, Caller("a"), "a3"),
        ({"a": "13", "b": "4"}, Caller("b"), "b4"),
        ({"a_x": "11", "a_y": "3", "b": "4"}, Caller("b"), "ay3"),
    ],
)
def test_or_of_whoever_has_most_by_another_measure(waiting, newcomer, out):
    item, _ = filled(**waiting).crowd_out(newcomer, lambda item: int(item[-1]))
    assert item == out


def test_nobody_is_crowded_out_of_an_empty_queue():
    assert FairQueue().crowd_out(Caller("a")) is None


def test_of_a_callers_items_those_of_higher_priority_come_first_and_callers_take_turns():
    queue = FairQueue(priority=int)
    for item, name, connection in [
        ("0", "a", "x"),
        ("-1", "a", "x"),
        ("2", "a", "y"),
        ("1", "a", "x"),
        ("-3", "b", "x"),
        ("5", "b", "x"),
    ]:
        queue.add(item, Caller(name, connection))
    assert emptied(queue) == ["2", "5", "1", "-3", "0", "-1"]


def test_of_whoever_has_most_the_last_of_the_least_priority_is_crowded_out():
    queue = FairQueue[tuple[str, int]](priority=lambda item: item[1])
    for item in (("first", 1), ("low", -1), ("middle", 0), ("lower", -1)):
        queue.add(item, Caller("a"))
    assert [queue.crowd_out(Caller("b"))[0][0] for _ in range(3)] == ["lower", "low", "middle"]
