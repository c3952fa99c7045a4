"""Plugins are loaded each alone, and what is wrong with one is said where it matters."""

import itertools
import os
import subprocess
import sys
from importlib.metadata import DistributionFinder, MetadataPathFinder, entry_points

import pytest

from sketchmatch.errors import InvalidInputError, PluginError, Reason
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, StrokeSet
from sketchmatch.registry import (
    Kind,
    PluginRules,
    PluginState,
    Registered,
    RegisteredReader,
    Registry,
    default_registry,
    discover,
    reader_by_keys,
    reader_by_name,
)
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.tools import ROOT, require

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
    assert (status.distribution, status.state, status.reason) == ("sketchmatch", "ACTIVE", "")


def test_what_a_third_party_offers_is_not_the_engine_s_own():
    searcher = default_registry().find(Kind.SEARCHER, "align").algorithm
    assert default_registry().is_own(searcher())
    for own in ("acme-search", "sketchmatch-more"):
        assert not Registry([Registered(Kind.SEARCHER, searcher, own, "1")]).is_own(searcher())


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
            "it has sketchmatch_register_searcher, which is not a hook; hooks are: "
            "sketchmatch_register_histograms, sketchmatch_register_judges, ",
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
            SEARCHER.replace("    def search", "    class Params: pass\n\n    def search").format(
                name="x"
            ),
            "Lucky.Params does not derive from sketchmatch.api.Params",
        ),
        ("raise SystemExit(3)", "SystemExit: 3"),
        ("", "it offers no algorithm"),
        (SEARCHER.format(name="Lucky One"), "use small letters, digits and hyphens"),
        (
            SEARCHER.replace("return [Lucky]", "return [Lucky, Lucky]").format(name="x"),
            "it offers 2 searchers named 'x'",
        ),
        (
            SEARCHER.replace(
                "    def search", "    class Params(Params):\n        tries: int\n\n    def search"
            ).format(name="x"),
            "Lucky.Params.tries has no default",
        ),
        (
            HEADER
            + """
from sketchmatch.api import Segmenter

class Finder(Segmenter):
    name = "finder"
    summary = "Finds."
    sources = (str,)

    def segment(self, source):
        raise NotImplementedError

@hookimpl
def sketchmatch_register_segmenters():
    return [Finder]
""",
            "Finder.sources is not a tuple of some of StrokeSet, PolygonSet, OccupancyGrid, Image",
        ),
        (
            "sketchmatch_api_version = 99\n" + SEARCHER.format(name="x"),
            "it is written for version 99 of the plugin API, but this engine has 1; upgrade sketch",
        ),
        (
            "sketchmatch_api_version = 0\n" + SEARCHER.format(name="x"),
            "it is written for version 0 of the plugin API, but this engine has 1; upgrade the pl",
        ),
        (
            "sketchmatch_api_version = '1'\n" + SEARCHER.format(name="x"),
            "sketchmatch_api_version is '1', which is not a whole number",
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
    assert failed.state is PluginState.FAILED
    assert words in failed.reason
    assert (good.state, good.reason) == (PluginState.ACTIVE, "")
    assert registry.problems == (
        f"plugin acme-broken of acme-broken 0.3 failed to load: {failed.reason}",
    )
    with pytest.raises(PluginError, match=r"acme-broken 0\.3 failed to load: .*plugins\.strict to"):
        registry.refuse_problems()
    assert [item.name for item in registry.algorithms] == ["lucky"]


def test_a_request_for_what_a_broken_plugin_may_have_offered_tells_of_it(install):
    points = install("raise RuntimeError('no licence')", "acme-broken")
    registry = discover([*points, *install(SEARCHER.format(name="lucky"), "acme-good")])
    with pytest.raises(InvalidInputError) as caught:
        registry.find(Kind.SEARCHER, "clever")
    assert caught.value.reason is Reason.UNKNOWN_ALGORITHM
    assert caught.value.field == "name"
    assert caught.value.problem == (
        "is 'clever', which is not a searcher; plugin acme-broken of acme-broken failed to load: "
        "RuntimeError: no licence; choose one of: lucky"
    )


def test_of_two_with_the_same_name_neither_is_taken_and_both_are_named(install):
    source = SEARCHER.format(name="lucky")
    registry = discover([*install(source, "acme-one", "1.1"), *install(source, "acme-two", "2.2")])
    sentence = (
        "is offered by acme-one 1.1 and acme-two 2.2{}; "
        "uninstall one of them or put it into plugins.deny"
    )
    with pytest.raises(InvalidInputError) as caught:
        registry.find(Kind.SEARCHER, "lucky")
    assert caught.value.problem == "is 'lucky', which " + sentence.format("")
    assert registry.of_kind(Kind.SEARCHER) == ()
    told = "searcher 'lucky' " + sentence.format(": neither is used")
    assert registry.problems == (told,)
    assert [(status.state, status.reason) for status in registry.statuses] == [
        (PluginState.ACTIVE, told),
        (PluginState.ACTIVE, told),
    ]


def test_a_plugin_cannot_take_the_name_of_a_built_in_algorithm_away(install):
    own = next(point for point in entry_points(group="sketchmatch") if point.name == "builtin")
    registry = discover([*install(SEARCHER.format(name="auto"), "acme-search", "2.1"), own])
    assert registry.find(Kind.SEARCHER, "auto").distribution == "sketchmatch"
    theirs, ours = registry.statuses
    assert "that of sketchmatch is used" in theirs.reason
    assert ours.reason == ""
    assert registry.problems == (theirs.reason,)


def test_only_what_the_rules_let_in_is_loaded(install):
    lucky = install(SEARCHER.format(name="lucky"), "Acme_Search", "2.1")
    for rules, reason in [
        (PluginRules.of(deny=["acme.search"]), "the configuration denies it (plugins.deny)"),
        (PluginRules.of(allow=["other"]), "the configuration does not allow it (plugins.allow)"),
        (PluginRules.of(allow=["acme-search"], deny=["acme-search"]), "the configuration denies"),
    ]:
        registry = discover(lucky, rules)
        (status,) = registry.statuses
        assert status.state is PluginState.DISABLED
        assert status.reason.startswith(reason)
        assert lucky[0].value not in sys.modules, "it was not even imported"
        assert registry.problems == ()
        with pytest.raises(InvalidInputError, match=r"plugin .* is disabled: the configuration"):
            registry.find(Kind.SEARCHER, "lucky")
    assert discover(lucky, PluginRules.of(allow=["ACME-search"])).find(Kind.SEARCHER, "lucky")


def test_the_engines_own_algorithms_are_there_whatever_the_rules_say():
    registry = discover(rules=PluginRules.of(allow=[], deny=["sketchmatch"]))
    assert registry.find(Kind.SEARCHER, "auto")


def test_a_plugin_that_takes_for_ever_to_load_is_left_behind(install):
    endless = install("import time\nwhile True:\n    time.sleep(0.01)", "acme-endless")
    good = install(SEARCHER.format(name="lucky"), "acme-good")
    registry = discover([*endless, *good], loading_seconds=1.0)
    assert [status.state for status in registry.statuses] == ["FAILED", "ACTIVE"]
    assert registry.statuses[0].reason == (
        "TimeoutError: it was not loaded after 1 s; do less at import"
    )


BROKEN_CASES = ROOT.parent / "shared" / "data" / "cases" / "81-plugins"
GROUP = "[sketchmatch]\nlucky = acme_lucky\n"
METADATA = "Metadata-Version: 2.1\nName: acme-lucky\nVersion: 1.0\n"


def discovered_beside(folder, monkeypatch):
    """Return what becomes of the plugins in a folder; the engine's own are there beside them."""
    monkeypatch.syspath_prepend(folder)
    registry = discover()
    assert registry.find(Kind.SEARCHER, "auto").distribution == "sketchmatch"
    ours = ("sketchmatch", "sketchmatch-example-searcher")
    return [status for status in registry.statuses if status.distribution not in ours]


@pytest.mark.parametrize(
    ("name", "distribution", "reason"),
    [
        ("badenc", "acme-badenc", "its entry_points.txt cannot be read (UnicodeDecodeError: "),
        ("badep", "acme-badep", "its entry_points.txt cannot be read ("),
        ("badep2", "acme-badep2", "AttributeError: "),
        ("base", "acme-base", "B: x"),
        ("exit", "acme-exit", "SystemExit: 3"),
        ("kbd", "acme-kbd", "KeyboardInterrupt"),
        ("missingmod", "acme-missing", "ModuleNotFoundError: "),
        (
            "noname",
            "acme-noname",
            "its METADATA cannot be read (ValueError: its metadata has no Name); inst",
        ),
        ("recur", "acme-recur", "RecursionError: "),
        ("syntax", "acme-syntax", "SyntaxError: "),
        ("ver", "acme-ver", "ValueError: it offers no algorithm"),
    ],
)
def test_a_broken_distribution_is_listed_alone(name, distribution, reason, monkeypatch):
    require(BROKEN_CASES.exists(), "shared/data/cases/81-plugins")
    (status,) = discovered_beside(BROKEN_CASES / name, monkeypatch)
    assert (status.distribution, status.state) == (distribution, PluginState.FAILED)
    assert status.reason.startswith(reason)


@pytest.mark.parametrize("name", ["leftover", "leftover2", "othergroup"])
def test_a_broken_distribution_of_something_else_is_no_news(name, monkeypatch):
    require(BROKEN_CASES.exists(), "shared/data/cases/81-plugins")
    assert discovered_beside(BROKEN_CASES / name, monkeypatch) == []


def test_of_two_versions_the_first_counts(tmp_path, monkeypatch):
    for version in ("1.0", "2.0"):
        folder = tmp_path / version
        (folder / f"acme_lucky-{version}.dist-info").mkdir(parents=True)
        info = next(folder.iterdir())
        (info / "METADATA").write_text(METADATA.replace("1.0", version), encoding="utf-8")
        (info / "entry_points.txt").write_text(GROUP, encoding="utf-8")
        monkeypatch.syspath_prepend(folder)
    (status,) = discovered_beside(tmp_path, monkeypatch)
    assert status.version == "2.0"


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({"entry_points.txt": GROUP}, "its METADATA cannot be read ("),
        ({"entry_points.txt": GROUP, "METADATA": ""}, "its METADATA cannot be read ("),
        (
            {"entry_points.txt": GROUP, "METADATA": METADATA.encode() + b"Summary: \xe9\n"},
            "its METADATA cannot be read (UnicodeDecodeError: ",
        ),
        (
            {"entry_points.txt": GROUP.encode("utf-16"), "METADATA": METADATA},
            "its entry_points.txt cannot be read (UnicodeDecodeError: ",
        ),
        ({"entry_points.txt": f"{GROUP}[", "METADATA": METADATA}, "its entry_points.txt cannot"),
        ({"entry_points.txt": GROUP, "METADATA": METADATA}, "ModuleNotFoundError: "),
        ({"entry_points.txt": "\0\xff" * 50, "METADATA": METADATA}, None),
        ({"METADATA": METADATA, "RECORD": "\0"}, None),
        ({"METADATA": "\0"}, None),
        ({}, None),
    ],
)
def test_whatever_is_wrong_with_a_distribution_the_rest_works(files, reason, tmp_path, monkeypatch):
    info = tmp_path / "acme_lucky-1.0.dist-info"
    info.mkdir()
    for name, content in files.items():
        (info / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (tmp_path / "acme_gone.egg-link").symlink_to(tmp_path / "nowhere")
    (tmp_path / "acme_round-1.0.dist-info").symlink_to(tmp_path / "acme_round-1.0.dist-info")
    (tmp_path / "acme_file-1.0.dist-info").write_bytes(b"")
    found = [
        status
        for status in discovered_beside(tmp_path, monkeypatch)
        if status.distribution != "acme-round"
    ]
    assert [(one.distribution, one.version, one.state) for one in found] == [
        ("acme-lucky", "1.0", PluginState.FAILED)
    ] * (reason is not None)
    assert all(status.reason.startswith(reason) for status in found)


def test_a_broken_distribution_can_be_denied(tmp_path, monkeypatch):
    info = tmp_path / "Acme_Lucky-1.0.dist-info"
    info.mkdir()
    (info / "entry_points.txt").write_text("[sketchmatch]\nlucky", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    registry = discover()
    told = "distribution acme-lucky 1.0 failed to load: its entry_points.txt cannot be read ("
    assert any(problem.startswith(told) for problem in registry.problems)
    with pytest.raises(InvalidInputError, match="distribution acme-lucky failed to load: its ent"):
        registry.find(Kind.SEARCHER, "lucky")
    registry = discover(rules=PluginRules.of(deny=["acme-lucky"]))
    assert not any("acme-lucky" in problem for problem in registry.problems)


@pytest.mark.slow
def test_a_broken_distribution_harms_no_library_that_reads_them_all(tmp_path):
    info = tmp_path / "acme_lucky-1.0.dist-info"
    info.mkdir()
    (info / "entry_points.txt").write_text("[console_scripts]\nlucky", encoding="utf-8")
    code = """
import sketchmatch.config
from sketchmatch.kernels.pairs import pair_index
print(pair_index(1, 2, 5))
"""
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path},
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout == "4\n"


def test_the_source_of_an_algorithm_is_what_its_text_refers_to(install):
    text = """Guesses.

    References
    ----------
    .. [1] A. Author, "Luck", 1999.
    B. Writer, "Chance",
    2001.

    Notes
    -----
    Nothing to add.
    """
    with_source = SEARCHER.replace("Guesses.", text, 1)
    (item,) = discover(install(with_source.format(name="lucky"), "acme-search")).algorithms
    assert item.source == '[1] A. Author, "Luck", 1999. B. Writer, "Chance", 2001.'


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


READER = """
from sketchmatch.api import Reader, hookimpl
from sketchmatch.model import PolygonSet

class Plans(Reader):
    name = "plans"
    summary = "Plans."
    suffixes = (".plan", ".plan.json")
    keys = ("walls",)
    source = PolygonSet

    def read(self, data, part=""):
        return PolygonSet(())

@hookimpl
def sketchmatch_register_readers():
    return [Plans]
"""


def test_a_plugin_may_bring_readers_alone(install):
    registry = discover(install(READER, "acme-plans", "0.2"))
    (reader,) = registry.readers
    assert reader.origin == "reader plans of acme-plans 0.2"
    assert reader.read(b"").polygons == ()
    assert registry.statuses[0].state is PluginState.ACTIVE
    assert registry.without("acme-plans").readers == ()


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("return [Plans]", "return [3]", "offers 3, which is not a Reader"),
        ("def read(", "def look(", "Plans does not define read"),
        ('name = "plans"', 'name = "My Plans"', "use small letters, digits and hyphens"),
        ('(".plan", ".plan.json")', '".plan"', "Plans.suffixes is not a tuple of strings"),
        ('(".plan", ".plan.json")', '(".json",)', "Plans reads '.json'; use small letters, as in"),
        ('(".plan", ".plan.json")', '("plan",)', "Plans reads 'plan'; use small letters"),
        ('("walls",)', "(3,)", "Plans.keys is not a tuple of strings"),
        (
            "source = PolygonSet",
            "source = dict",
            "Plans.source is not one of StrokeSet, PolygonSet",
        ),
        (
            'suffixes = (".plan", ".plan.json")\n    keys = ("walls",)',
            "",
            "Plans has neither suffixes nor keys to recognise its files by",
        ),
    ],
)
def test_a_reader_that_is_none_is_reported(install, before, after, words):
    assert before in READER
    (status,) = discover(install(READER.replace(before, after), "acme-plans")).statuses
    assert status.state is PluginState.FAILED
    assert words in status.reason


def test_of_several_readers_the_longest_suffix_and_the_most_keys_decide(install):
    other = (
        READER.replace("plans", "longer")
        .replace(".plan", ".my.plan")
        .replace('("walls",)', '("walls", "doors")')
    )
    readers = discover([*install(READER, "acme-a"), *install(other, "acme-b")]).readers
    assert reader_by_name(readers, "house.plan").name == "plans"
    assert reader_by_name(readers, "house.My.PLAN").name == "longer"
    assert reader_by_name(readers, "house.json") is None
    assert reader_by_keys(readers, ["walls", "roof"]).name == "plans"
    assert reader_by_keys(readers, ["roof", "doors", "walls"]).name == "longer"
    assert reader_by_keys(readers, ["doors"]) is None


def test_of_two_readers_of_the_same_files_ours_is_taken_and_otherwise_both_are_named(install):
    readers = discover([*install(READER, "acme-a"), *install(READER, "acme-b")]).readers
    with pytest.raises(InvalidInputError, match=r"reader plans of acme-a 1\.0 and reader plans of"):
        reader_by_name(readers, "x.plan")
    with pytest.raises(InvalidInputError, match=r"put one of them into plugins\.deny"):
        reader_by_keys(readers, ["walls"])
    ours = RegisteredReader(readers[0].reader, "sketchmatch", "1")
    assert reader_by_name([*readers, ours], "x.plan") is ours


def test_without_any_plugin_nothing_can_be_chosen():
    with pytest.raises(InvalidInputError, match="choose one of: none"):
        discover([]).find(Kind.SEARCHER, "easm")


def test_an_algorithm_of_the_engines_own_is_the_default_that_says_so_itself():
    class Usual(CrossCorrelation):
        name = "usual"
        default = True

    class Inherits(Usual):
        name = "inherits"

    def registry(*owned):
        return Registry(Registered(Kind.SIMILARITY, each, owner, "1.0") for each, owner in owned)

    both = registry((Inherits, "sketchmatch"), (Usual, "sketchmatch"))
    assert both.default(Kind.SIMILARITY) == "usual"
    assert registry((Usual, "acme-search")).default(Kind.SIMILARITY) == ""
    assert registry((Inherits, "sketchmatch")).default(Kind.SIMILARITY) == ""


@pytest.mark.parametrize(
    ("source", "name"),
    [
        (StrokeSet, "strokes"),
        (PolygonSet, "polygons"),
        (OccupancyGrid, "occupancy-grid"),
        (Image, "image"),
    ],
)
def test_each_form_of_source_has_its_default_segmenter(source, name):
    assert default_registry().default(Kind.SEGMENTER, source) == name
