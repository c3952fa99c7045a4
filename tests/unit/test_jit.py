"""How kernels are compiled is said in one place, and old machine code never outlives its source."""

import os
import re
import subprocess
import sys

import numba
import numpy as np
import pytest
from platformdirs import user_cache_path

from sketchmatch.kernels import _jit
from sketchmatch.kernels.confidence import fmap_confidence, mean_absolute_difference
from sketchmatch.kernels.projection import project
from tests.interpreted import compiled_only
from tests.tools import ROOT, require

NUMBA = re.compile(r"\b(numba|n?jit)\b")


def test_only_one_module_calls_numba():
    callers = [
        path.relative_to(ROOT).as_posix()
        for folder in ("engine", "plugins")
        for path in (ROOT / folder).rglob("*.py")
        if NUMBA.search(without_text(path.read_text(encoding="utf-8")))
    ]
    assert callers == ["engine/sketchmatch/kernels/_jit.py"]


def without_text(source):
    return re.sub(r'""".*?"""|#[^\n]*', "", source, flags=re.S)


@compiled_only
@pytest.mark.parametrize("function", [fmap_confidence, mean_absolute_difference, project])
def test_kernels_run_without_the_gil_and_without_fast_math(function):
    assert function.targetoptions["nogil"] is True
    assert not function.targetoptions.get("fastmath")


@compiled_only
def test_a_kernel_computes_what_its_python_does():
    values = np.array([3.0, -1.0, 4.0, 1.5])
    assert mean_absolute_difference(values.copy()) == mean_absolute_difference.py_func(values)


PACKAGE = {
    "inner.py": """
from sketchmatch.kernels._jit import kernel
@kernel
def step(x):
    return x + 1
""",
    "constants.py": "FACTOR = 10",
    "outer.py": """
from constants import FACTOR
from inner import step
from sketchmatch.kernels._jit import kernel, on_compile
@kernel
def walk(x):
    return FACTOR * step(x)
names = []
with on_compile(names.append):
    print(walk(1), *names)
""",
}


def run_outer(folder, cache=None):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache or folder / "cache")}
    command = [sys.executable, "-B", "outer.py"]
    done = subprocess.run(
        command, cwd=folder, env=environment, check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


@pytest.mark.slow
@compiled_only
def test_a_change_in_another_file_is_compiled_anew(tmp_path):
    write(tmp_path, PACKAGE)

    def printed():
        return run_outer(tmp_path).split()

    assert printed() == ["20", "walk", "step"]
    assert printed() == ["20"], "nothing has changed"
    (tmp_path / "inner.py").write_text(PACKAGE["inner.py"].replace("+ 1", "+ 2"), encoding="utf-8")
    assert printed() == ["30", "walk", "step"]
    (tmp_path / "constants.py").write_text("FACTOR = 100", encoding="utf-8")
    assert printed() == ["300", "walk"]


def write(folder, package):
    folder.mkdir(exist_ok=True)
    for name, text in package.items():
        (folder / name).write_text(text, encoding="utf-8")


@pytest.mark.slow
@compiled_only
def test_the_same_source_elsewhere_is_not_compiled_again(tmp_path):
    require(hasattr(numba.config, "CACHE_LOCATOR_CLASSES"), "a numba that asks where code is kept")
    for folder, printed in (("here", "20 walk step"), ("there", "20")):
        write(tmp_path / folder, PACKAGE)
        assert run_outer(tmp_path / folder, tmp_path / "cache") == printed


@pytest.mark.slow
@compiled_only
def test_a_module_of_the_same_source_and_another_name_has_its_own(tmp_path):
    write(tmp_path, PACKAGE)
    assert run_outer(tmp_path) == "20 walk step"
    (tmp_path / "inner.py").rename(tmp_path / "other.py")
    text = PACKAGE["outer.py"].replace("from inner", "from other")
    (tmp_path / "outer.py").write_text(text, encoding="utf-8")
    assert run_outer(tmp_path) == "20 walk step"


@compiled_only
def test_a_cache_that_cannot_be_written_keeps_nothing_from_running(tmp_path):
    write(tmp_path, PACKAGE)
    (tmp_path / "file").write_bytes(b"")
    assert run_outer(tmp_path, tmp_path / "file" / "cache") == "20 walk step"


MAKER = {
    "maker.py": """
from sketchmatch.kernels._jit import kernel
def twice(step):
    @kernel
    def compute(x):
        return step(step(x))
    return compute
""",
    "step.py": """
from sketchmatch.kernels._jit import kernel
@kernel
def step(x):
    return x + 1
""",
    "outer.py": """
from maker import twice
from step import step
from sketchmatch.kernels._jit import kernel
both = twice(step)
@kernel
def walk(x):
    return both(x)
print(walk(1))
""",
}


@pytest.mark.slow
@compiled_only
@pytest.mark.parametrize(
    ("name", "before", "after"),
    [("maker.py", "step(step(x))", "step(step(step(x)))"), ("step.py", "+ 1", "+ 2")],
)
def test_a_change_in_what_makes_a_kernel_is_compiled_anew(tmp_path, name, before, after):
    write(tmp_path, MAKER)
    assert run_outer(tmp_path) == "3"
    (tmp_path / name).write_text(MAKER[name].replace(before, after), encoding="utf-8")
    assert run_outer(tmp_path) == {"maker.py": "4", "step.py": "5"}[name]


@pytest.mark.slow
@compiled_only
def test_a_second_process_finds_all_histograms_compiled():
    code = """
import sketchmatch_builtin
from sketchmatch.kernels._jit import on_compile
names = []
with on_compile(names.append):
    for histogram in sketchmatch_builtin.sketchmatch_register_histograms():
        histogram.warm_up()
print(*names)
"""
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code], check=True, capture_output=True, text=True
        )
    assert done.stdout.split() == []


@compiled_only
def test_the_first_match_compiles_nothing_that_the_warm_up_did_not():
    code = """
import gc
import sketchmatch
from numba.core.dispatcher import Dispatcher
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import Kind, default_registry
from tests.server.harness import shapes

def compiled():
    kernels = [item for item in gc.get_objects() if isinstance(item, Dispatcher)]
    ours = [one for one in kernels if one.py_func.__module__.startswith("sketchmatch")]
    return {f"{one.py_func.__name__}{types}" for one in ours for types in one.signatures}

registry = default_registry()
warm_up(registry)
warm_up_others(registry)
warm = compiled()
scene = sketchmatch.Scene.from_polygons(shapes(4))
for item in registry.algorithms:
    if item.kind in (Kind.HISTOGRAM, Kind.SIMILARITY):
        sketchmatch.match(scene, scene, **{item.kind.value: item.name})
print(*(compiled() - warm), sep="\\n")
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


def test_the_cache_lies_where_the_environment_says(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert _jit._cache_folder(without_text).parent == tmp_path
    before = numba.config.CACHE_DIR
    _jit.kernel(without_text)
    assert before == numba.config.CACHE_DIR, "kernels of other programs go where they went"


def test_the_cache_lies_with_those_of_the_user_else(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    place = user_cache_path("sketchmatch", appauthor=False) / "kernels"
    assert _jit._cache_folder(without_text).parent == place


@compiled_only
def test_compilation_is_announced_by_name_and_loading_is_not(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    def doubled(x):
        return 2 * x

    names = []
    first = _jit.kernel(doubled)
    with _jit.on_compile(names.append):
        assert first(21) == 42
        assert first(1) == 2
    assert names == ["doubled"]
    again = _jit.kernel(doubled)
    with _jit.on_compile(names.append):
        assert again(21) == 42
    assert names == ["doubled"]
