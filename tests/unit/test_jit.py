"""How kernels are compiled is said in one place, and old machine code never outlives its source."""

import errno
import hashlib
import importlib
import os
import pickle
import pkgutil
import re
import subprocess
import sys
from collections import Counter
from enum import EnumType
from pathlib import Path

import numpy as np
import pytest
from platformdirs import user_cache_path

import sketchmatch.kernels
import sketchmatch_builtin
from sketchmatch.kernels import _jit
from sketchmatch.kernels.confidence import fmap_confidence, mean_absolute_difference
from sketchmatch.kernels.projection import project
from tests.interpreted import compiled_only
from tests.tools import ROOT

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


@pytest.mark.slow
@compiled_only
def test_two_processes_that_compile_at_once_leave_a_cache_that_is_whole(tmp_path):
    write(tmp_path, PACKAGE)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-B", "outer.py"]
    both = [subprocess.Popen(command, cwd=tmp_path, env=environment) for _ in range(2)]
    assert [process.wait() for process in both] == [0, 0]
    assert run_outer(tmp_path) == "20"


FULL_DISK = {
    "outer.py": """
import resource
from sketchmatch.kernels._jit import kernel
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))  # the probe of a temporary folder fits
@kernel
def step(x):
    return x + 1
@kernel
def walk(x):
    return 10 * step(x)
print(walk(1))
"""
}


@pytest.mark.slow
@compiled_only
def test_a_full_disk_keeps_nothing_from_running_and_is_told_of_once(tmp_path):
    write(tmp_path, FULL_DISK)
    usual, temporary = tmp_path / "usual", tmp_path / "temporary"
    temporary.mkdir()
    done = subprocess.run(
        [sys.executable, "-B", "outer.py"],
        cwd=tmp_path,
        env={**os.environ, "NUMBA_CACHE_DIR": str(usual), "TMPDIR": str(temporary)},
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout == "20\n"
    assert done.stderr == (
        f"sketchmatch cannot keep compiled kernels in {usual} (File too large) and compiles them "
        "at each start; NUMBA_CACHE_DIR can name a folder that can be written\n"
    )
    left = [path for folder in (usual, temporary) for path in folder.rglob("*") if path.is_file()]
    assert left == []


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


@pytest.mark.slow
@compiled_only
def test_what_a_server_waits_for_is_compiled_once(tmp_path):
    code = """
from collections import Counter
from sketchmatch.kernels._jit import on_compile
from sketchmatch.pipeline.warmup import warm_up
from sketchmatch.registry import default_registry
names = []
with on_compile(names.append):
    warm_up(default_registry())
print(Counter(names))
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    count = eval(done.stdout, {"Counter": Counter})
    kernels = {"fmap_confidence", "fmap_confidence_above", "mean_parts", "measure", "project"}
    assert {name: count[name] for name in kernels} == dict.fromkeys(kernels, 1)
    # What numba brings for these compiles a dozen functions more: sorting, and assigning arrays.
    assert count.keys() & {"run_quicksort", "raise_impl", "concat_impl"} == set()


@pytest.mark.slow
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
small, large = (sketchmatch.Scene.from_polygons(shapes(n)) for n in (4, 5))
chosen = [{item.kind.value: item.name} for item in registry.algorithms]
for options in [
    *(one for one in chosen if Kind.SEGMENTER.value not in one),
    {"searcher": "easm", "params": {"searcher": {"consistency": "pairwise"}}},
    {"weights": (1, 1, 1, 1, 1, 1), "allow_unmatched": True},
]:
    sketchmatch.match(small, large, **options)
    sketchmatch.match(large, small, **options)
print(*(compiled() - warm), sep="\\n")
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


@compiled_only
@pytest.mark.usefixtures("caches")
def test_compilation_is_announced_by_name_and_loading_is_not():
    assert compiled_by_a_call() == ["doubled"]
    assert compiled_by_a_call() == []


def compiled_by_a_call():
    """Return the names of what a process compiles that knows nothing of earlier ones."""

    def doubled(x):
        return 2 * x

    names = []
    compiled = _jit.kernel(doubled)
    with _jit.on_compile(names.append):
        assert compiled(21) == 42
        assert compiled(1) == 2
    return names


@pytest.fixture
def caches(tmp_path, monkeypatch):
    """Return where compiled kernels are kept, and where else, and begin with nothing told."""
    usual, temporary = tmp_path / "usual", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(usual))
    monkeypatch.setattr(_jit, "gettempdir", lambda: str(temporary))
    _jit._tell.cache_clear()
    return usual, temporary


def emptied(file):
    file.write_bytes(b"")


def cut_short(file):
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def flipped(file):
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def random(file):
    file.write_bytes(np.random.default_rng(0).bytes(5000))


def other_text(file):
    file.write_text("{}\n", encoding="utf-8")


def of_what_is_no_longer_there(file):
    write_sealed(file, b"cno_such_module\nanything\n.")


def of_another_numba(file):
    held = pickle.loads(file.read_bytes()[32:])
    write_sealed(file, pickle.dumps({key: pickle.dumps(("old",)) for key in held}))


def write_sealed(file, content):
    file.write_bytes(hashlib.sha256(content).digest() + content)


@compiled_only
@pytest.mark.parametrize(
    "damage",
    [
        emptied,
        cut_short,
        flipped,
        random,
        other_text,
        of_what_is_no_longer_there,
        of_another_numba,
    ],
)
def test_a_file_that_is_damaged_is_compiled_anew_and_written_over(caches, damage, caplog):
    usual, temporary = caches
    assert compiled_by_a_call() == ["doubled"]
    (file,) = usual.iterdir()
    damage(file)
    assert compiled_by_a_call() == ["doubled"]
    assert compiled_by_a_call() == []
    assert (list(usual.iterdir()), list(temporary.rglob("*.code"))) == ([file], [])
    assert caplog.messages == []


@compiled_only
def test_where_there_can_be_no_folder_kernels_are_kept_in_a_temporary_one(caches, caplog):
    usual, temporary = caches
    usual.write_bytes(b"a file")
    assert compiled_by_a_call() == ["doubled"]
    assert compiled_by_a_call() == []
    (folder,) = temporary.iterdir()
    assert caplog.messages == [
        f"sketchmatch cannot keep compiled kernels in {usual} (File exists) and keeps them in "
        f"{folder}; NUMBA_CACHE_DIR can name a folder that can be written"
    ]


def homeless(*_, **__):
    raise RuntimeError("could not determine the home directory")


def unexpanded(*_, **__):
    return Path("~/.cache/sketchmatch")


@compiled_only
@pytest.mark.parametrize("cache_path", [homeless, unexpanded])
def test_without_a_home_kernels_are_kept_in_a_temporary_folder(
    caches, cache_path, caplog, monkeypatch
):
    _, temporary = caches
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr(_jit, "user_cache_path", cache_path)
    assert compiled_by_a_call() == ["doubled"]
    assert compiled_by_a_call() == []
    (folder,) = temporary.iterdir()
    assert caplog.messages == [
        "sketchmatch cannot keep compiled kernels in a home folder, because there is none, and "
        f"keeps them in {folder}; NUMBA_CACHE_DIR can name a folder that can be written"
    ]


@compiled_only
@pytest.mark.usefixtures("caches")
def test_a_cache_that_can_only_be_read_is_read(caplog, monkeypatch):
    assert compiled_by_a_call() == ["doubled"]

    def refused(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(_jit, "_write", refused)
    assert compiled_by_a_call() == []
    assert caplog.messages == []


@compiled_only
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="temporary folders are each user's own here")
def test_machine_code_in_a_folder_that_others_can_write_is_never_used(caches, caplog):
    usual, temporary = caches
    usual.write_bytes(b"a file")
    folder = temporary / f"sketchmatch-{os.getuid()}"
    compiled_by_a_call()
    folder.chmod(0o777)
    assert compiled_by_a_call() == ["doubled"]
    assert "and compiles them at each start" in caplog.messages[-1]
    link = temporary / "elsewhere"
    folder.chmod(0o700)
    folder.rename(link)
    folder.symlink_to(link)
    assert compiled_by_a_call() == ["doubled"]


@compiled_only
@pytest.mark.usefixtures("caches")
def test_kernels_are_kept_side_by_side_for_each_types_of_arguments():
    def doubled(x):
        return 2 * x

    first, again = _jit.kernel(doubled), _jit.kernel(doubled)
    names = []
    with _jit.on_compile(names.append):
        assert (first(1), first(1.5)) == (2, 3.0)
        assert (again(1), again(1.5)) == (2, 3.0)
    assert names == ["doubled", "doubled"]


def test_the_cache_lies_where_the_environment_says(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert next(_jit._folders()) == tmp_path


def test_the_cache_lies_with_those_of_the_user_else(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    place = user_cache_path("sketchmatch", appauthor=False) / "kernels"
    assert next(_jit._folders()) == place


@compiled_only
def test_no_kernel_takes_places_from_an_enum():
    """Before 0.68 numba takes no member of an enum for an index."""
    modules = [
        importlib.import_module(found.name)
        for package in (sketchmatch.kernels, sketchmatch_builtin)
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    kernels = [
        each.py_func
        for module in modules
        for each in vars(module).values()
        if hasattr(each, "py_func") and each.py_func.__module__ == module.__name__
    ]
    assert len(kernels) > 100
    assert not [
        (kernel.__qualname__, name)
        for kernel in kernels
        for name in kernel.__code__.co_names
        if isinstance(kernel.__globals__.get(name), EnumType)
    ]
