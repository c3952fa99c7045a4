"""The mutants that ``make mutation`` tries: each one change, known by its lines."""

from pathlib import Path

import pytest

from tests.mutation import __main__ as runs
from tests.mutation.modules import Module, modules
from tests.mutation.mutants import mutants
from tests.mutation.trial import Copy
from tests.tools import ROOT


def changed(line):
    """Return what becomes of the only line of a function."""
    source = f"def f(x, y):\n    {line}\n"
    found = mutants("m.py", source)
    for mutant in found:
        assert mutant.line == 2
        assert mutant.applied(source) == f"def f(x, y):\n    {mutant.after}\n"
        assert mutant.compiles(source)
    return {mutant.after for mutant in found}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("return x < y", ["return x <= y", "return x > y"]),
        ("return x == y", ["return x != y"]),
        ("return x is None", ["return x is not None"]),
        ("return x not in y", ["return x in y"]),
        ("return ζ(x) + y / ü", ["return ζ(x) - y / ü", "return ζ(x) + y * ü"]),
        ("return x // y", ["return x * y"]),
        ("return x - 0.5", ["return x + 0.5", "return x - 1.5", "return x - (-0.5)"]),
        ("return x ** 2", ["return x * 2", "return x ** 3", "return x ** 1"]),
        ("return not x", ["return x"]),
        ("return -x", ["return x"]),
        ("return x and y", ["return x or y"]),
        ("return True", ["return False"]),
        ("return min(x, y)", ["return max(x, y)"]),
        ("return g(x, y, x)", ["return g(y, x, x)"]),
        ("return x if y else z", ["return (x)", "return (z)"]),
        ("x += y", ["x -= y", "pass"]),
        ("x[y] = z", ["pass"]),
        ("g()", ["pass"]),
        (
            "return x if x else 1",
            ["return (x)", "return (1)", "return x if x else 2", "return x if x else 0"],
        ),
    ],
)
def test_a_line_changes_in_each_of_these_ways(line, expected):
    assert changed(line) == set(expected)


def test_loops_and_early_ends_change():
    source = """
def f(x):
    for k in x:
        if k:
            continue
        while x:
            return k
"""
    found = {(mutant.line, mutant.before, mutant.after) for mutant in mutants("m.py", source)}
    assert found == {
        (4, "if k:", "if not (k):"),
        (5, "continue", "break"),
        (5, "continue", "pass"),
        (6, "while x:", "while not (x):"),
        (7, "return k", "pass"),
    }


@pytest.mark.parametrize(
    "source",
    [
        '"""Text: 1 + 1."""',
        "from a import b",
        "__all__ = ['a' + 'b']",
        "def f(x: A[1]) -> A[1]:\n    'text'\n    return x",
        "@g(1)\nclass A(B[1]):\n    x: C[2]",
        "X = 'text'",
    ],
)
def test_what_does_not_run_stays(source):
    assert mutants("m.py", source) == []


def test_mutants_of_equal_lines_have_names_of_their_own():
    found = mutants("m.py", "x = y + z\nx = y + z\n")
    assert [mutant.name for mutant in found] == [
        "m.py: x = y + z → x = y - z",
        "m.py: x = y + z → x = y - z (2)",
    ]
    assert [mutant.line for mutant in found] == [1, 2]


def module(path, source):
    made = Module("group", path, (), (True,))
    vars(made)["source"] = source
    return made


def test_a_sample_is_the_same_whatever_else_is_there():
    source = "\n".join(f"x{k} = y + z" for k in range(50))
    names = [mutant.name for _, mutant in runs.sample([module("m.py", source)], 20, set())]
    assert len(set(names)) == 20
    moved = module("m.py", f"import a\n\n{source}\n\nx = 'text'\n")
    assert [mutant.name for _, mutant in runs.sample([moved], 20, set())] == names
    left_out = runs.sample([moved], 20, {names[3]})
    assert names[3] not in [mutant.name for _, mutant in left_out]
    assert len({mutant.name for _, mutant in left_out} & set(names)) == 19
    another = [mutant.name for _, mutant in runs.sample([moved], 20, set(), "2")]
    assert set(another) != set(names)


def test_what_is_no_program_is_not_tried():
    source = "f(*x, y)\nf(y, k=z)\nprint(x := 1)\n"
    for _, mutant in runs.sample([module("m.py", source)], 100, set()):
        compile(mutant.applied(source), "m.py", "exec")


def test_every_module_has_tests_that_exist():
    found = modules()
    assert {each.group for each in found} == {
        "alignment",
        "drawings",
        "judges",
        "kernels",
        "pipeline",
        "searchers",
        "svg",
        "transfers",
    }
    missing = {path for each in found for path in each.tests if not (ROOT / path).is_file()}
    assert not missing


def test_equivalent_mutants_are_mutants_of_today_and_have_a_reason():
    listed = runs.read_equivalent()
    today = {mutant.name for each in modules() for mutant in mutants(each.path, each.source)}
    assert set(listed) <= today
    assert all(reason.endswith(".") for reason in listed.values())


@pytest.mark.slow
def test_a_mutant_is_tried_in_a_copy_and_killed_where_a_test_fails(tmp_path, monkeypatch):
    home = tmp_path / "home"
    for path, text in {
        "engine/sketchmatch/__init__.py": "",
        "engine/sketchmatch/sums.py": "def double(x):\n    return x + x\n",
        "tests/mutation/__init__.py": "",
        "tests/conftest.py": (
            "from hypothesis import settings\nsettings.register_profile('same', derandomize=True)\n"
        ),
        **{
            path: (ROOT / path).read_text("utf-8")
            for path in ("tests/interpreted.py", "tests/mutation/quick.py")
        },
        "tests/test_sums.py": (
            "from sketchmatch.sums import double\n"
            "def test_it():\n    assert double(2) == 4\n    assert double(0) == 0\n"
        ),
        "pyproject.toml": "[tool.pytest.ini_options]\naddopts = '--import-mode=importlib'\n",
    }.items():
        (home / path).parent.mkdir(parents=True, exist_ok=True)
        (home / path).write_text(text, encoding="utf-8")
    monkeypatch.setattr("tests.mutation.trial.ROOT", home)
    copy = Copy(tmp_path / "copy")
    made = Module("group", "engine/sketchmatch/sums.py", ("tests/test_sums.py",), (True, False))
    before = Path(home / made.path).read_text(encoding="utf-8")
    assert copy.killer(made, before.replace("x + x", "x - x")) == "tests/test_sums.py::test_it"
    assert copy.killer(made, before.replace("x + x", "2 * x")) is None
    waiting = f"{before}    while True:\n        pass\n".replace("return x + x", "x = x + x")
    assert copy.killer(made, waiting) == "tests/test_sums.py::test_it (out of time)"
    assert (home / made.path).read_text("utf-8") == before
    assert (tmp_path / "copy" / made.path).read_text("utf-8") == before
    (home / "tests/test_sums.py").write_text("def test_it(): assert 0", "utf-8")
    with pytest.raises(RuntimeError, match="without any change"):
        Copy(tmp_path / "another").killer(made, before)
