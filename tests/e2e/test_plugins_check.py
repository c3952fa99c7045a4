"""``sketchmatch plugins check``: what a distribution's plugins do, and how each check ends."""

import json
import os
import re

import pytest

from tests.processes import sketchmatch

pytestmark = pytest.mark.slow  # it starts processes

PLUGIN = '''
import os
import re

import numpy as np

from sketchmatch.api import Similarity, hookimpl


class Good(Similarity):
    """How far one has to walk from one histogram to the other, along streets."""

    name = "good"
    summary = "One minus half the mean absolute difference."

    def compare(self, aligned, argument):
        print("walking")
        return 1.0 - 0.5 * np.abs(aligned - argument).mean(axis=1)


class Looping(Good):
    """How far one has to walk from one histogram to the other, in a circle."""

    name = "looping"

    def compare(self, aligned, argument):
        while True:
            pass


class Matching(Good):
    """How far one has to walk, if one is not kept by a regular expression."""

    name = "matching"

    def compare(self, aligned, argument):
        if len(aligned) == 5:
            re.match("(a+)+$", 64 * "a" + "b")
        return super().compare(aligned, argument)


class Leaving(Good):
    """How far one has to walk, if one does not leave before."""

    name = "leaving"

    def compare(self, aligned, argument):
        if len(aligned) == 5:
            os._exit(7)
        return super().compare(aligned, argument)


class Writing(Good):
    """How far one has to walk, and where one was before is no longer known."""

    name = "writing"

    def compare(self, aligned, argument):
        aligned -= argument
        return 1.0 - 0.5 * np.abs(aligned).mean(axis=1)


@hookimpl
def sketchmatch_register_similarities():
    return [globals()[name] for name in OFFERED]
'''


@pytest.fixture
def installed(tmp_path):
    """Return what installs a distribution as pip would, and the environment that has it."""

    def install(distribution: str, text: str, group: str = "sketchmatch"):
        module = distribution.replace("-", "_")
        info = tmp_path / f"{module}-1.2.dist-info"
        info.mkdir()
        metadata = f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.2\n"
        (info / "METADATA").write_text(metadata, encoding="utf-8")
        points = f"[{group}]\n{distribution} = {module}\n"
        (info / "entry_points.txt").write_text(points, encoding="utf-8")
        (tmp_path / f"{module}.py").write_text(text, encoding="utf-8")
        before = os.environ.get("PYTHONPATH", "")
        return {"PYTHONPATH": os.pathsep.join(filter(None, [str(tmp_path), before]))}

    return install


def check(env, *arguments):
    return sketchmatch("plugins", "check", *arguments, env=os.environ | env)


def rows(done):
    """Return result and sentence by algorithm and check, of what a pipe is given."""
    head, *lines = (line.split("\t") for line in done.stdout.splitlines())
    assert head == ["kind", "algorithm", "check", "result", "seconds", "sentence"]
    assert all(float(seconds) >= 0.0 for _, _, _, _, seconds, _ in lines)
    return {(name, which): (state, words) for _, name, which, state, _, words in lines}


def test_a_plugin_that_keeps_every_contract_passes(installed):
    done = check(installed("acme-good", PLUGIN + "\nOFFERED = ['Good']\n"), "acme-good")
    assert done.returncode == 0
    found = rows(done)
    assert found["", "loads"][0] == "passed"
    assert found["good", "answers-repeat"] == (
        "passed",
        "Give the very same answer to the same input, and seed, bit by bit.",
    )
    assert found["good", "combine-agrees-with-compare"] == (
        "skipped",
        "it derives from Similarity, and not from ProductSimilarity",
    )
    assert len(found) == 21
    assert "sketchmatch: acme-good 1.2: 20 passed, 0 failed, 1 skipped in " in done.stderr
    assert "walking" in done.stderr


def test_checks_that_never_end_are_named_and_the_others_go_on(installed):
    offered = ["Looping", "Matching", "Leaving", "Writing"]
    env = installed("acme-bad", f"{PLUGIN}\nOFFERED = {offered}\n")
    done = check(env, "ACME_bad", "--time-limit", "0.5")
    assert done.returncode == 5
    found = rows(done)
    place = r"at acme_bad\.py, line \d+, in compare"
    endless = rf"it did not end within 0\.5 s {place}"
    first, second, *rest = [
        value
        for (name, which), value in found.items()
        if name == "looping" and which in CHECKS_THAT_COMPARE
    ]
    for state, words in (first, second):
        assert state == "failed"
        assert re.fullmatch(endless, words)
    assert set(rest) == {("skipped", "2 checks before did not end")}
    assert found["looping", "alignment-is-known"][0] == "passed"
    assert found["matching", "rows-are-compared-alone"] == (
        "failed",
        "it did not end within 0.5 s, and held up the interpreter",
    )
    assert found["leaving", "rows-are-compared-alone"] == (
        "failed",
        "it ended its process (exit code 7)",
    )
    for name in ("matching", "leaving"):
        assert found[name, "inputs-stay-untouched"][0] == "passed"
    assert found["writing", "inputs-stay-untouched"] == (
        "failed",
        "it wrote to aligned of 12 pairs of rows",
    )
    assert found["writing", "threads-agree"][1].startswith("it wrote to what it is given, ")


CHECKS_THAT_COMPARE = (
    "similarity-is-within-0-and-1",
    "equal-rows-have-similarity-1",
    "rows-are-compared-alone",
    "answers-repeat",
    "threads-agree",
    "inputs-stay-untouched",
)


def test_one_document_says_the_same(installed):
    done = check(installed("acme-good", PLUGIN + "\nOFFERED = ['Good']\n"), "acme-good", "--json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    checks = document.pop("checks")
    assert document == {
        "distribution": "acme-good",
        "version": "1.2",
        "passed": 20,
        "failed": 0,
        "skipped": 1,
    }
    last = checks[-1]
    assert last.pop("seconds") >= 0.0
    assert last == {
        "kind": "similarity",
        "algorithm": "good",
        "check": "inputs-stay-untouched",
        "result": "passed",
        "sentence": "Leave what it is given as it is, byte by byte.",
        "demand": "Leave what it is given as it is, byte by byte.",
        "overdue": False,
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("import surely_not_there", "ModuleNotFoundError: No module named 'surely_not_there'"),
        ("import os; os._exit(3)", "it ended its process (exit code 3) while it was loaded"),
    ],
)
def test_a_plugin_that_does_not_load_fails(installed, text, sentence):
    done = check(installed("acme-bad", text), "acme-bad")
    assert done.returncode == 5
    (state, words), *others = rows(done).values()
    assert (state, others) == ("failed", [])
    assert words.endswith(sentence)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("acme-absent", "DISTRIBUTION 'acme-absent' is not installed here; choose one of: "),
        ("", "DISTRIBUTION '' is not installed here; choose one of: "),
        ("acme-other", "DISTRIBUTION 'acme-other' has no entry point in the group sketchmatch; "),
    ],
)
def test_what_offers_nothing_is_refused(installed, name, sentence):
    done = check(installed("acme-other", "", group="other"), name)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(f"sketchmatch: {sentence}")
    assert "sketchmatch\n" in done.stderr
    assert len(done.stderr.splitlines()) == 1
