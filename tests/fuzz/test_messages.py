"""Broken requests of every method are answered or refused, and leave a server as it was."""

import random

import pytest

from tests.fuzz.messages import METHODS, broken, fuzzed, requests_of

pytestmark = pytest.mark.slow


def test_broken_requests_end_nothing_and_are_no_fault_of_the_server():
    report = fuzzed(15.0, seed=7)
    assert report.findings == []
    for method in METHODS:
        assert report.codes[method.name, "INVALID_ARGUMENT"] > 0, method.name
    answered = {name for name, code in report.codes if code == "OK"}
    assert {method.name for method in METHODS} - answered <= {"WatchSketch"}
    before, after = report.memory
    assert after < before + 400.0


def test_requests_are_broken_in_many_ways():
    rng = random.Random(1)
    for method in METHODS:
        seeds = requests_of(method)
        assert len({broken(rng, rng.choice(seeds)) for _ in range(60)}) > 5, method.name
