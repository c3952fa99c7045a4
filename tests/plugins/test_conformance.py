"""Every built-in keeps the contracts that plugins are held to."""

import pytest

from sketchmatch.registry import default_registry
from sketchmatch.registry.distributions import OWN_DISTRIBUTION
from sketchmatch.testing import parametrize_plugins
from sketchmatch_builtin.histograms.raster import RasterForce

BUILT_IN = [
    item.algorithm
    for item in default_registry().algorithms
    if item.distribution == OWN_DISTRIBUTION
]


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    for algorithm in BUILT_IN:
        algorithm.warm_up()


CONTRACTS = parametrize_plugins(
    BUILT_IN,
    expected_failures={
        RasterForce: {
            "rotation-shifts-the-rows": "a border of pixels is another after a turn by 10°"
        }
    },
)
# What takes seconds: whole plans are cut into rooms dozens of times, and swarms fly.
SLOW = {
    "Direct-threads-agree",
    "Easm-threads-agree",
    "FsnnPso-threads-agree",
    "ImageSegmenter-threads-agree",
    "NnPso-threads-agree",
    "Posterior-threads-agree",
    "RoomSegmenter-answers-repeat",
    "RoomSegmenter-blank-sources-are-refused",
    "RoomSegmenter-inputs-stay-untouched",
    "RoomSegmenter-scenes-are-found",
    "RoomSegmenter-threads-agree",
    "RoomSegmenter-warnings-are-sentences",
    "RoomSegmenter-y-points-up",
}


def marked(case):
    if case.id not in SLOW:
        return case
    return pytest.param(*case.values, id=case.id, marks=(*case.marks, pytest.mark.slow))


def test_what_is_slow_is_among_the_contracts():
    assert {case.id for case in CONTRACTS.args[1]} >= SLOW


@pytest.mark.parametrize(CONTRACTS.args[0], [marked(case) for case in CONTRACTS.args[1]])
def test_it_keeps_the_contract(check):
    check()
