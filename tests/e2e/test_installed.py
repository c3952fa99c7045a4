"""What a new installation has is enough, and what a server loads before it serves is enough."""

import os
import subprocess
import sys

import pytest

from tests.interpreted import compiled_only

MATCHES = """
import numpy as np
from sketchmatch import match
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.testing import random_scene, simulate_sketch

def matches():
    rng = np.random.default_rng(0)
    place = random_scene(rng, 9)
    drawn = simulate_sketch(place, rng, objects=range(1, 8)).scene
    yield match(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
    for pair in ((drawn, place), (place, drawn), (place, place)):
        yield match(*pair)
        yield match(*pair, alternatives=3, pins={0: 0, 1: None})
        yield match(*pair, allow_unmatched=False, weights=(1, 1, 1, 1, 1, 1))
        yield match(*pair, weights=(1, 1, 1, 1, 1))
"""


def said_by(code, **environment):
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.slow
@compiled_only
def test_what_is_no_dependency_is_not_needed():
    # Some functions of NumPy work in kernels only where SciPy is installed, and abort elsewhere.
    without = "import sys\nsys.modules['scipy'] = None\n"
    said = said_by(without + MATCHES + "print(*(len(each.object_map) > 2 for each in matches()))")
    assert said == ["True"] * 13


@compiled_only
@pytest.mark.slow
def test_what_is_loaded_before_a_server_serves_is_all_that_a_match_compiles(tmp_path):
    said = said_by(
        "from sketchmatch.kernels._jit import on_compile\n"
        "from sketchmatch.pipeline.warmup import warm_up\n"
        "from sketchmatch.registry import default_registry\n" + MATCHES + "warm, later = [], []\n"
        "with on_compile(warm.append):\n"
        "    warm_up(default_registry())\n"
        "with on_compile(later.append):\n"
        "    print(len([*matches()]), len(warm) > 50, *later)\n",
        NUMBA_CACHE_DIR=str(tmp_path),
    )
    assert said == ["13", "True"]
