"""Which requests are expected to take long."""

from sketchmatch.app.lengths import Lengths
from sketchmatch.app.orders import Order


def order(size, kind="MatchRequest"):
    return Order("", kind, bytes(size))


def test_what_is_as_large_as_one_that_took_long_is_expected_to_take_long_too():
    lengths = Lengths()
    assert not lengths.is_long(order(5000))
    lengths.learn(order(5000), long=True)
    assert lengths.is_long(order(4096))
    assert lengths.is_long(order(8191))
    assert not lengths.is_long(order(4095))
    assert not lengths.is_long(order(8192))
    assert not lengths.is_long(order(5000, "SegmentRequest"))


def test_three_of_the_other_sort_change_what_is_expected():
    lengths = Lengths()
    lengths.learn(order(1000), long=False)
    expected = []
    for long in (True, True, True, False, False, False):
        lengths.learn(order(1000), long=long)
        expected.append(lengths.is_long(order(1000)))
    assert expected == [False, False, True, False, False, False]
    lengths = Lengths()
    lengths.learn(order(1000), long=True)
    expected = []
    for _ in range(3):
        lengths.learn(order(1000), long=False)
        expected.append(lengths.is_long(order(1000)))
    assert expected == [True, True, False]


def test_of_a_size_that_never_came_the_large_are_expected_to_take_long():
    lengths = Lengths()
    assert not lengths.is_long(order(16_384))
    assert lengths.is_long(order(16_385))
    lengths.learn(order(20_000), long=False)
    assert not lengths.is_long(order(20_000))
    assert lengths.is_long(order(40_000))
