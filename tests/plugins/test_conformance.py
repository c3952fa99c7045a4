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


@parametrize_plugins(
    BUILT_IN,
    expected_failures={
        RasterForce: {
            "rotation-shifts-the-rows": "a border of pixels is another after a turn by 10°"
        }
    },
)
def test_it_keeps_the_contract(check):
    check()
