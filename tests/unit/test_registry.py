"""Plugins are loaded each alone, and what is wrong with one is said where it matters."""

import itertools
from importlib.metadata import DistributionFinder, MetadataPathFinder

import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.registry import Kind, discover

HEADER = """
from sketchmatch.api import Histogram, Params, Searcher, Similarity, hookimpl
"""
SEARCHER = (
    HEADER
    + """
class Lucky(Searcher):
    '''Guesses.'''

    name = "{name}"
    summary = "Guesses."

    def search(self, problem, rng):
        yield from ()

@hookimpl
def sketchmatch_register_searchers():
    return [Lucky]
"""
)


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return what puts a plugin's distribution on the path and returns its entry points."""
    monkeypatch.syspath_prepend(tmp_path)
    numbers = itertools.count()

    def put(source, distribution, version="1.0"):
        # A module of its own name each time: Python keeps what it has imported.
        module = f"{tmp_path.name}_{next(numbers)}".replace("-", "_")
        (tmp_path / f"{module}.py").write_text(source, encoding="utf-8")
        info = tmp_path / f"{distribution.replace('-', '_')}-{version}.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n", encoding="utf-8"
        )
        (info / "entry_points.txt").write_text(
            f"[sketchmatch]\n{distribution} = {module}\n", encoding="utf-8"
        )
        (found,) = MetadataPathFinder.find_distributions(
            DistributionFinder.Context(name=distribution, path=[str(tmp_path)])
        )
        return list(found.entry_points)

    return put


def test_the_built_in_algorithms_are_found_like_any_others():
    registry = discover()
    assert {(item.kind.value, item.name) for item in registry.algorithms} >= {
        ("segmenter", "polygons"),
        ("segmenter", "strokes"),
        ("segmenter", "occupancy-grid"),
        ("segmenter", "image"),
        ("histogram", "constant"),
        ("similarity", "cross-correlation"),
        ("searcher", "auto"),
        ("searcher", "easm"),
        ("searcher", "direct"),
        ("searcher", "exact"),
    }
    (status,) = (s for s in registry.statuses if s.entry_point == "builtin")
    assert (status.distribution, status.failure) == ("sketchmatch", "")


def test_every_built_in_algorithm_describes_itself_and_its_parameters():
    for item in discover().algorithms:
        assert item.algorithm.summary.endswith(".")
        assert len(item.description) > len(item.algorithm.summary)
        for name, field in item.schema["properties"].items():
            assert field.get("description"), f"{item.name}.{name} has no description"
            assert "default" in field, f"{item.name}.{name} has no default"


def test_a_third_partys_plugin_is_found(install):
    registry = discover(install(SEARCHER.format(name="lucky"), "acme-search", "2.1"))
    found = registry.find(Kind.SEARCHER, "lucky")
    assert (found.distribution, found.version) == ("acme-search", "2.1")
    assert found.description == "Guesses."
    assert found.schema["properties"] == {}


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise RuntimeError('no licence')", "RuntimeError: no licence"),
        ("import surely_not_installed", "ModuleNotFoundError: No module named"),
        ("def broken(:", "SyntaxError"),
        (
            HEADER + "@hookimpl\ndef sketchmatch_register_searcher():\n    return []",
            "unknown hook 'sketchmatch_register_searcher'",
        ),
        (
            HEADER + "@hookimpl\ndef sketchmatch_register_searchers():\n    raise OSError('disk')",
            "OSError: disk",
        ),
        (
            HEADER + "@hookimpl\ndef sketchmatch_register_searchers():\n    return None, 3",
            "offers None, which is not a Searcher",
        ),
        (
            SEARCHER.replace("def search(", "def look(").format(name="x"),
            "Lucky does not define search",
        ),
        (
            SEARCHER.replace("(Searcher)", "(Similarity)").format(name="x"),
            "which is not a Searcher",
        ),
        (SEARCHER.replace('name = "{name}"', ""), "Lucky.name is not a string"),
        (SEARCHER.replace('summary = "Guesses."', "summary = 3"), "Lucky.summary is not a string"),
        (
            SEARCHER.replace("    def search", "    class Params: pass\n\n    def search"),
            "Lucky.Params does not derive from sketchmatch.api.Params",
        ),
    ],
)
def test_a_broken_plugin_is_reported_and_stops_no_other(install, source, words):
    broken = install(source, "acme-broken", "0.3")
    registry = discover([*broken, *install(SEARCHER.format(name="lucky"), "acme-good")])
    failed, good = registry.statuses
    assert (failed.entry_point, failed.distribution, failed.version) == (
        "acme-broken",
        "acme-broken",
        "0.3",
    )
    assert words in failed.failure
    assert good.failure == ""
    assert [item.name for item in registry.algorithms] == ["lucky"]


def test_a_request_for_what_a_broken_plugin_may_have_offered_tells_of_it(install):
    points = install("raise RuntimeError('no licence')", "acme-broken")
    registry = discover([*points, *install(SEARCHER.format(name="lucky"), "acme-good")])
    with pytest.raises(InvalidInputError) as caught:
        registry.find(Kind.SEARCHER, "clever")
    assert caught.value.reason is Reason.UNKNOWN_ALGORITHM
    assert caught.value.field == "name"
    assert caught.value.problem == (
        "is 'clever', which is no searcher; choose one of: lucky; plugin acme-broken of "
        "acme-broken failed to load: RuntimeError: no licence"
    )


def test_of_two_with_the_same_name_neither_is_taken_and_both_are_named(install):
    source = SEARCHER.format(name="lucky")
    registry = discover([*install(source, "acme-one", "1.1"), *install(source, "acme-two", "2.2")])
    with pytest.raises(InvalidInputError, match="uninstall one of them") as caught:
        registry.find(Kind.SEARCHER, "lucky")
    assert "both acme-one 1.1 and acme-two 2.2 offer" in caught.value.problem


def test_the_same_name_in_two_kinds_is_no_conflict(install):
    similarity = """
class Other(Similarity):
    name = "lucky"
    summary = "Likes everything."

    def compare(self, aligned, argument):
        return 1.0

@hookimpl
def sketchmatch_register_similarities():
    return [Other]
"""
    registry = discover(install(SEARCHER.format(name="lucky") + similarity, "acme-search"))
    assert registry.find(Kind.SEARCHER, "lucky").algorithm.__name__ == "Lucky"
    assert registry.find(Kind.SIMILARITY, "lucky").algorithm.__name__ == "Other"
    assert [item.name for item in registry.of_kind(Kind.HISTOGRAM)] == []


def test_without_any_plugin_nothing_can_be_chosen():
    with pytest.raises(InvalidInputError, match="choose one of: none"):
        discover([]).find(Kind.SEARCHER, "easm")
