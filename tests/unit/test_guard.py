"""What plugins return and raise is theirs to answer for, by name, whatever it is."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from sketchmatch.api import (
    Histogram,
    Outcome,
    Reader,
    Searcher,
    SearchProgress,
    Segmentation,
    Segmenter,
    Similarity,
)
from sketchmatch.errors import InvalidInputError, PluginError, Reason
from sketchmatch.model import Fmap, LabelledPolygon, PolygonSet, Scene, SceneObject
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import Choice
from sketchmatch.registry import (
    Kind,
    Registered,
    RegisteredReader,
    Registry,
    default_registry,
    discover,
)
from sketchmatch.testing import plugin_checks, score_fmap

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 2.0], [0.0, 2.0]])
STEPS = [[0.0, 0.0], [4.0, 0.0], [0.0, 5.0], [9.0, 9.0]]
SCENE = Scene.from_polygons([(k + 1) * SQUARE + np.array(step) for k, step in enumerate(STEPS)])
POLYGONS = PolygonSet(tuple(LabelledPolygon(item.rings) for item in SCENE.objects))


def engine_with(plugin):
    """Return an engine with a plugin of others."""
    kind = next(kind for kind in Kind if issubclass(plugin, kind.interface))
    offered = Registered(kind, plugin, "acme-plugins", "1.2")
    return Engine(Registry([*default_registry().algorithms, offered]))


def segmenter(found, sources=(PolygonSet,)):
    """Return a segmenter that finds something whatever it reads."""

    def segment(self, source):  # noqa: ARG001
        return found() if callable(found) else found

    told = {"name": "told", "summary": "As told.", "sources": sources, "segment": segment}
    return type("Told", (Segmenter,), told)


def segmented(found):
    plugin = segmenter(found)
    return engine_with(plugin).segment(POLYGONS, plugin(), "map")


def of_rings(*rings):
    """Return a scene of objects that nobody has checked."""
    return Segmentation(Scene(tuple(SceneObject((ring,)) for ring in rings)))


@pytest.mark.parametrize(
    ("ring", "words"),
    [
        (SQUARE.astype(np.int32), "is of int32, not float64"),
        (SQUARE[::-1], "goes the wrong way round"),
        (np.array([[0.0, 0.0], [np.nan, 0.0], [1.0, 1.0]]), "is not finite"),
        (SQUARE[:2], "has 2 distinct points"),
        (SQUARE[[0, 1, 2, 3, 0]], "has a point twice in a row"),
        (SQUARE[[0, 2, 1, 3]], "crosses itself"),
        (SQUARE.tolist(), "is a list, not an array"),
    ],
)
def test_an_object_that_is_none_is_the_segmenters_fault(ring, words):
    with pytest.raises(PluginError, match=words) as blamed:
        segmented(of_rings(SQUARE + 5.0, ring))
    sentence = str(blamed.value)
    assert sentence.startswith("segmenter told of acme-plugins 1.2 failed (")
    assert "its objects[1].rings[0]" in sentence or "its objects[1] crosses" in sentence


def test_what_is_no_object_is_the_segmenters_fault():
    for objects in (list(SCENE.objects), ("desk", "sofa")):
        with pytest.raises(PluginError, match="its objects"):
            segmented(Segmentation(Scene(objects)))


def test_what_from_rings_makes_is_sound():
    holed = SceneObject.from_rings([SQUARE, 0.5 * SQUARE + [0.5, 0.5]])
    assert len(segmented(Segmentation(Scene((holed, *SCENE.objects)))).scene) == 5


class Speechless(Exception):  # noqa: N818
    """Says nothing, and fails even in that."""

    def __str__(self):
        raise RuntimeError("no words")


class OwnError(InvalidInputError):
    """Is made in a way of its own."""

    def __init__(self):
        super().__init__(Reason.INVALID_POLYGON, "polygons[0]", "is not to my liking")


def histogram(describe, exponent=0.0):
    told = {"name": "told", "summary": "As told.", "exponent": exponent, "describe": describe}
    return type("Told", (Histogram,), told)


def raising(error):
    def describe(*_):
        raise error

    return histogram(describe)


def matched(plugin, stage):
    engine = engine_with(plugin)
    choices = {"searcher": Choice("exact"), "judge": Choice("confidence"), stage: Choice("told")}
    request = MatchRequest(SCENE, SCENE, choices)
    *_, last = engine.match(request)
    return last.result


@pytest.mark.parametrize(
    ("plugin", "words"),
    [
        (raising(Speechless()), "Speechless: its __str__ raised RuntimeError"),
        (raising(ValueError("bad \ud800 text")), "ValueError: bad \N{REPLACEMENT CHARACTER} text"),
        (raising(ValueError("y" * 5_000_000)), "ValueError: y+…"),
        (raising(InvalidInputError("MY_REASON", "x", "is bad")), "InvalidInputError: x is bad"),
        (raising(InvalidInputError(Reason.INVALID_FIELD, 3, None)), "InvalidInputError: 3 None"),
        (histogram(lambda *_: None, "two"), "its exponent is 'two', not a finite number"),
        (histogram(lambda *_: None, np.nan), "its exponent is nan, not a finite number"),
    ],
)
def test_whatever_a_plugin_raises_it_is_blamed_by_name(plugin, words):
    with pytest.raises(PluginError, match=words) as blamed:
        matched(plugin, "histogram")
    sentence = str(blamed.value)
    assert sentence.startswith("histogram told of acme-plugins 1.2 failed (")
    assert sentence.encode("utf-8")
    assert len(sentence) < 400


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            InvalidInputError(Reason.INVALID_POLYGON, "x\ud800", "is bad \ud800; go"),
            "x\N{REPLACEMENT CHARACTER} is bad \N{REPLACEMENT CHARACTER}; go",
        ),
        (OwnError(), "polygons[0] is not to my liking"),
    ],
)
def test_what_a_plugin_says_to_its_caller_can_be_told_everywhere(error, said):
    with pytest.raises(InvalidInputError) as refused:
        matched(raising(error), "histogram")
    assert str(refused.value).endswith(said)
    assert refused.value.within("map").reason is Reason.INVALID_POLYGON


def test_a_plugin_or_a_reader_that_cannot_say_why_it_fails_is_blamed_as_any_other():
    class Mute(Reader):
        def read(self, data, part=""):  # noqa: ARG002
            raise Speechless

    with pytest.raises(PluginError, match=r"^reader told of acme 1\.2 failed \(Speechless: its"):
        RegisteredReader(
            type("Told", (Mute,), {"name": "told", "source": PolygonSet}), "acme", "1.2"
        ).read(b"")
    point = EntryPoint("mute", "tests.unit.test_guard:loaded_in_vain", "sketchmatch")
    (status,) = discover([point]).statuses
    assert status.reason == "Speechless: its __str__ raised RuntimeError"


def __getattr__(name):
    if name == "loaded_in_vain":
        raise Speechless
    raise AttributeError(name)


def test_a_check_tells_of_what_cannot_say_why_it_fails():
    checks = {check.name: check for check in plugin_checks(raising(Speechless()))}
    assert "Speechless: its __str__ raised" in checks["rows-are-finite"].result().seen


def searcher(note="", outcome=Outcome.CONVERGED):
    """Return a searcher that is content with the first map."""

    def search(self, problem, rng):  # noqa: ARG001
        partners = np.arange(problem.table.template_objects)
        fmap = Fmap.from_object_map(partners, problem.table.argument_objects)
        confidence = score_fmap(fmap, problem.table, problem.weights).total
        yield SearchProgress(fmap, confidence, 1, 1, note=note)
        return outcome

    return type("Told", (Searcher,), {"name": "told", "summary": "As told.", "search": search})


@pytest.mark.parametrize(
    ("note", "told"),
    [
        ("a\nb\x1b[31mred", "a bred"),
        ("half \ud800", "half \N{REPLACEMENT CHARACTER}"),
        ("x" * 10_000_000, "x" * 1000 + "…"),
        ("σ × ζ, as it is", "σ × ζ, as it is"),
    ],
)
def test_a_note_of_a_search_is_one_line_that_somebody_can_read(note, told):
    assert matched(searcher(note), "searcher").search_note == told


@pytest.mark.parametrize("outcome", [Outcome.TIME_BUDGET, "SERVER_STOPPING"])
def test_a_search_that_speaks_for_the_host_is_blamed(outcome):
    with pytest.raises(PluginError, match=r"it returned [A-Z_]+, which only the host may say"):
        matched(searcher(outcome=outcome), "searcher")


def test_warnings_are_sentences_that_somebody_can_read():
    with pytest.raises(PluginError, match="its warnings are a str, not a tuple"):
        segmented(Segmentation(SCENE, "oops"))
    warnings = segmented(Segmentation(SCENE, ("w\ud800\x1b[2J" * 99_999,) * 300_000)).warnings
    assert len(warnings) == 1001
    assert warnings[-1] == "299000 more notes are left out."
    assert max(map(len, warnings)) <= 1001
    assert "\x1b" not in warnings[0]


def test_what_is_complex_is_refused_for_that():
    likeness = {"compare": lambda _, rows, __: np.full(len(rows), 0.5 + 0.5j)}
    told = {"name": "told", "summary": "As told."}
    words = "TypeError: the values are complex, not real"
    with pytest.raises(PluginError, match=words):
        matched(type("Told", (Similarity,), {**told, **likeness}), "similarity")
    rows = histogram(lambda self, _, pairs: np.full((len(pairs), self.directions), 1 + 1j))
    with pytest.raises(PluginError, match=words):
        matched(rows, "histogram")
    with pytest.raises(PluginError, match=words):
        segmented(Segmentation(SCENE, (), np.array([[0, 1j], [2, 3]])))
