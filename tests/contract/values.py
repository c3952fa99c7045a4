"""What the golden messages say, as the engine has it. All of it is written out, none is read."""

from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import Field

from sketchmatch.api import (
    Histogram,
    Judge,
    Outcome,
    Params,
    Reader,
    Searcher,
    Segmentation,
    Segmenter,
    Similarity,
)
from sketchmatch.model import (
    Confidence,
    ConfidenceWeights,
    GridPicture,
    Image,
    LabelledPolygon,
    OccupancyGrid,
    PolygonSet,
    Scene,
    SceneObject,
    Stroke,
    StrokeSet,
)
from sketchmatch.pipeline.events import Accepted, Finished, Phase, Progress, Segmented
from sketchmatch.pipeline.knowledge import Pin
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import (
    AlternativeMap,
    Ambiguity,
    Correspondence,
    MatchResult,
    ObjectGroup,
    ObjectMatch,
    ObjectRelation,
    Statistics,
)
from sketchmatch.pipeline.selection import Choice, Defaults, Pipeline, Profile
from sketchmatch.registry import (
    Kind,
    PluginState,
    PluginStatus,
    Registered,
    RegisteredReader,
    Registry,
)


def box(x0, x1, y0, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


BED, DESK, SHELF = box(1, 5, 1, 3), box(7, 9, 2, 5), box(2, 3, 6, 11)
# Turned by a quarter and doubled: (x, y) → (32 − 2y, 2x).
BUNK, TABLE, RACK = box(26, 30, 2, 10), box(22, 28, 14, 18), box(10, 20, 4, 6)
BAR = [box(2, 8, 12, 20), box(3, 5, 13, 17)[::-1]]
SKETCH = Scene.from_polygons([BED, DESK, SHELF], ["bed", "desk", "shelf"])
MAP = Scene.from_polygons([TABLE, BAR, BUNK, RACK], ["table", "bar", "bunk", "rack"])
WEIGHTS = ConfidenceWeights(
    similarity=1.5, rotation=2.5, dilation=0.75, shape=0.5, size=0.25, distance=1.25
)


class Tracing(Segmenter):
    """Outlines, traced.

    References
    ----------
    .. [1] A. Tracer, "Outlines", 1999.
    """

    name = "tracing"
    summary = "Traces outlines."
    sources = (StrokeSet, Image)

    class Params(Params):
        """Of tracing."""

        closing: float = Field(
            0.5, gt=0, le=9, description="Gap that is closed.", json_schema_extra={"unit": "m"}
        )
        mode: str = "rough"

    def segment(self, source):
        raise NotImplementedError


class Sheets(Reader):
    """Sheets, one polygon each."""

    name = "sheets"
    summary = "Sheets of paper."
    suffixes = (".sheet", ".sheet.json")
    keys = ("paper",)
    source = PolygonSet

    def read(self, data, part=""):
        corners = np.array(data.split(), dtype=float).reshape(-1, 2)
        return PolygonSet((LabelledPolygon((corners,), part),))


class Tiling(Segmenter):
    """Tiles, one by one."""

    name = "tiling"
    summary = "Takes each tile for an object."
    sources = (OccupancyGrid, PolygonSet)

    class Params(Params):
        """Of tiling."""

        least: int | None = None
        walls: bool = True

    def segment(self, source):
        raise NotImplementedError


class Compass(Histogram):
    """Directions, counted."""

    name = "compass"
    summary = "Counts directions."
    exponent = 0.0

    class Params(Params):
        """Of the compass."""

        directions: int = 180

    def describe(self, scene, pairs):
        raise NotImplementedError


class Alikeness(Similarity):
    """Alike, all of them."""

    name = "alikeness"
    summary = "Finds all alike."

    class Params(Params):
        """None."""

    def compare(self, aligned, argument):
        raise NotImplementedError


class Guessing(Searcher):
    """Guesses, again and again."""

    name = "guessing"
    summary = "Guesses."

    class Params(Params):
        """Of guessing."""

        rounds: int = 6

    def search(self, problem, rng):
        raise NotImplementedError


class Weighing(Judge):
    """Weighed, and found wanting."""

    name = "weighing"
    summary = "Weighs."

    class Params(Params):
        """Of the scales."""

        strictness: float = 0.5

    def judge(self, problem):
        raise NotImplementedError


TRACING = Tracing(Tracing.Params(closing=0.125, mode="neat"))

# Requests, by the names of the golden ones.

STROKES = StrokeSet(
    (
        Stroke(
            np.array([[1.5, -2.5], [3.5, -4.75], [5.25, -0.125]]),
            np.array([0.25, 0.5, 0.875]),
            "sofa",
        ),
        Stroke(np.array([[7.5, 8.5], [9.25, -6.5]]), None, "route"),
    )
)
GRID = OccupancyGrid(
    np.array([[0, 100, -1], [0, 100, 30]], dtype=np.int8), 0.05, (-1.5, 2.25, 0.75)
)
PICTURE = Image(np.array([[0, 64, 128], [192, 224, 255]], dtype=np.uint8))
SOURCES = {
    "SegmentRequest": PolygonSet(
        (
            LabelledPolygon(
                (
                    np.array([[2.0, -12.0], [8.0, -12.0], [8.0, -20.0], [2.0, -20.0]]),
                    np.array([[3.0, -17.0], [5.0, -17.0], [5.0, -13.0], [3.0, -13.0]]),
                ),
                "bar",
            ),
            LabelledPolygon((np.array([[1.5, -2.5], [4.5, -3.5], [0.5, -6.5]]),), certainty=0.375),
        )
    ),
    "SegmentRequest.stroke_set": StrokeSet(
        (Stroke(np.array([[1.5, 2.5], [3.5, 4.75], [5.25, 0.125]]), None, "lamp"),)
    ),
    "SegmentRequest.occupancy_grid": OccupancyGrid(
        np.array([[0, 100], [-1, 0], [100, 30]], dtype=np.int8), 0.125
    ),
    "SegmentRequest.map_server_map": OccupancyGrid(
        np.array([[0, 100, 0], [100, 0, -1]], dtype=np.int8),
        0.25,
        (-1.5, 2.25, 0.75),
        picture=GridPicture(np.array([[1, 255, 1], [255, 1, 127]], dtype=np.uint8), 0.196),
    ),
    "SegmentRequest.mended_map": OccupancyGrid(
        np.array([[0, 100, 0], [100, 0, -1]], dtype=np.int8),
        0.25,
        (-1.5, 2.25, 0.75),
        picture=GridPicture(np.array([[1, 255, 1], [255, 1, 127]], dtype=np.uint8), 0.196),
        objects=PolygonSet(
            (LabelledPolygon((np.array([[1.5, 2.5], [4.5, 3.5], [0.5, 6.5]]),), "oven", 0.625),)
        ),
    ),
    "SegmentRequest.image": PICTURE,
    "SegmentRequest.file": PolygonSet(
        (LabelledPolygon((np.array([[1.5, 2.5], [4.5, 3.5], [0.5, 6.5]]),), "cellar"),)
    ),
}
NOTHING_CHOSEN = {
    "sketch_segmenter": Choice(),
    "map_segmenter": Choice(),
    "histogram": Choice(),
    "similarity": Choice(),
    "searcher": Choice(),
    "judge": Choice(),
}
MATCHES = {
    "MatchRequest": MatchRequest(
        sketch=STROKES,
        map=GRID,
        selection={
            "sketch_segmenter": Choice("tracing", {"closing": 0.125, "mode": "neat"}),
            "map_segmenter": Choice("tiling", {"least": None, "walls": True}),
            "histogram": Choice("compass", {"directions": 36}),
            "similarity": Choice("alikeness", {"shares": [0.5, "rest", False]}),
            "searcher": Choice("guessing", {"limits": {"rounds": 9, "quiet": True}}),
            "judge": Choice("weighing", {"scales": ["gold", 2.5]}),
        },
        seed=2**53 + 1,
        time_budget=3.25,
        weights=WEIGHTS,
        alternatives=5,
        profile="careful",
        allow_unmatched=True,
        unmatched_price=0.4375,
        pins=(Pin("sofa", 3), Pin(0, "couch", excluded=True), Pin(2, None)),
        synonyms=(("couch", "sofa", "settee"), ("desk", "bureau")),
    ),
    "MatchRequest.sparse": MatchRequest(
        sketch=PICTURE,
        map=PolygonSet(
            (
                LabelledPolygon((np.array([[1.0, 2.0], [4.0, 2.0], [4.0, 8.0]]),)),
                LabelledPolygon((np.array([[5.0, 3.0], [9.0, 3.0], [9.0, 6.0]]),)),
            )
        ),
        selection={**NOTHING_CHOSEN, "searcher": Choice("", {"rounds": 4})},
        seed=0,
        time_budget=None,
        weights=ConfidenceWeights(0.5, 0.0, 2.0, 0.0, 0.0, 0.0),
        alternatives=None,
        profile="",
        allow_unmatched=False,
        unmatched_price=None,
    ),
    "MatchRequest.named": MatchRequest(
        sketch=PolygonSet((LabelledPolygon((np.array([[1.0, 2.0], [4.0, 2.0], [4.0, 8.0]]),)),)),
        map=PolygonSet((LabelledPolygon((np.array([[5.0, 3.0], [9.0, 3.0], [9.0, 6.0]]),)),)),
        selection=NOTHING_CHOSEN,
    ),
    "MatchRequest.turned": MatchRequest(
        sketch=PolygonSet(
            (
                LabelledPolygon((np.array(BED, dtype=float),), "bed"),
                LabelledPolygon((np.array(DESK, dtype=float),), "desk"),
                LabelledPolygon((np.array(SHELF, dtype=float),), "shelf"),
            )
        ),
        map=PolygonSet(
            (
                LabelledPolygon((np.array(TABLE, dtype=float),), "table"),
                LabelledPolygon(tuple(np.array(ring, dtype=float) for ring in BAR), "bar"),
                LabelledPolygon((np.array(BUNK, dtype=float),), "bunk"),
                LabelledPolygon((np.array(RACK, dtype=float),), "rack"),
            )
        ),
        selection={
            **NOTHING_CHOSEN,
            "histogram": Choice("", {"directions": 36}),
            "searcher": Choice("exact"),
            "judge": Choice("confidence"),
        },
        seed=7,
        time_budget=None,
        weights=ConfidenceWeights(1.0, 2.0, 3.0, 0.5, 0.25, 1.5),
        alternatives=2,
        profile="",
        allow_unmatched=None,
        unmatched_price=None,
    ),
}

# The events of a match, by the names of the golden responses.

ROUTE = np.array([[0.5, 12.5], [4.5, 7.25], [10.75, 0.25]])
ACCEPTED = Accepted(
    match_id="match-41",
    seed=2**53 + 1,
    pipeline=Pipeline(
        sketch_segmenter=TRACING,
        map_segmenter=Tiling(),
        histogram=Compass(Compass.Params(directions=36)),
        similarity=Alikeness(),
        searcher=Guessing(Guessing.Params(rounds=9)),
        judge=Weighing(Weighing.Params(strictness=0.75)),
        profile="careful",
    ),
    weights=WEIGHTS,
    unmatched_price=0.4375,
)
SEGMENTED = Segmented(
    sketch=Segmentation(SKETCH, ("strokes[4] encloses nothing and was left out",), ROUTE),
    map=Segmentation(MAP, ("2 specks were left out", "a doorway was closed")),
)
PROGRESS = Progress(
    phase=Phase.SEARCH,
    elapsed=1.25,
    fraction=0.625,
    iteration=41,
    evaluations=1300,
    confidence=0.71,
    upper_bound=0.93,
    matches=(
        ObjectMatch(sketch_object=1, map_object=3, confidence=0.78),
        ObjectMatch(sketch_object=2, map_object=0, confidence=0.64),
    ),
)
RESULT = MatchResult(
    matches=(
        ObjectMatch(
            sketch_object=1,
            map_object=3,
            confidence=0.81,
            margin=0.12,
            relation=ObjectRelation(2, "to the right of and below", 0.59),
            probability=0.77,
        ),
        ObjectMatch(
            sketch_object=2,
            map_object=0,
            confidence=0.83,
            margin=-0.02,
            relation=ObjectRelation(1, "to the left of", 0.63),
            probability=0.69,
        ),
    ),
    omap_confidence=0.82,
    confidence=Confidence(
        total=0.91, similarity=0.87, rotation=0.95, dilation=0.86, shape=0.74, size=0.66
    ),
    fmap=(
        Correspondence(
            sketch_pair=(1, 2), map_pair=(3, 0), similarity=0.89, rotation=-0.75, dilation=2.375
        ),
    ),
    rotation=1.75,
    scale=2.125,
    outcome=Outcome.ITERATION_LIMIT,
    upper_bound=0.97,
    seed=2**53 + 1,
    match_id="match-41",
    statistics=Statistics(
        iterations=37,
        evaluations=1234,
        seconds=MappingProxyType(
            {"segment": 0.125, "describe": 0.25, "relate": 0.5, "search": 1.5, "total": 2.625}
        ),
    ),
    sketch=SKETCH,
    map=MAP,
    alternatives=(
        AlternativeMap(
            matches=(
                ObjectMatch(sketch_object=0, map_object=2, confidence=0.53),
                ObjectMatch(sketch_object=2, map_object=1, confidence=0.51),
            ),
            confidence=Confidence(
                total=0.79, similarity=0.72, rotation=0.85, dilation=0.62, shape=0.56, size=0.47
            ),
            omap_confidence=0.52,
            probability=0.285,
        ),
        AlternativeMap(
            matches=(ObjectMatch(sketch_object=1, map_object=0, confidence=0.44),),
            confidence=Confidence(total=0.61, similarity=0.58, rotation=0.67, dilation=0.55),
            omap_confidence=0.43,
            probability=0.115,
        ),
    ),
    search_note="every map of two objects was tried",
    probability=0.365,
    place_probability=0.905,
    ambiguity=Ambiguity(maps=2, alternatives=(0,), deciding_sketch_objects=(0, 1, 2)),
    unmatched_sketch_probabilities=(0.575,),
    groups=(ObjectGroup((0, 1), (3,), 0.735), ObjectGroup((2,), (0, 1, 2))),
)
EVENTS = {
    "MatchResponse.accepted": ACCEPTED,
    "MatchResponse.scenes": SEGMENTED,
    "MatchResponse.progress": PROGRESS,
    "MatchResponse.result": Finished(RESULT),
}
"""What is asked for is ``MATCHES["MatchRequest"]``, on other sources."""

# What answers the other methods.

SEGMENTATION = Segmentation(
    Scene((SceneObject.from_polygon(BAR, "bar"), SceneObject.from_rings([RACK], certainty=0.625))),
    ("2 specks were left out", "a doorway was closed"),
    ROUTE[:2],
    ((0, 1),),
)
REGISTRY = Registry(
    [
        Registered(Kind.SEARCHER, Guessing, "acme-tiles", "2.1"),
        Registered(Kind.SEGMENTER, Tracing, "acme-pens", "1.3"),
        Registered(Kind.SEGMENTER, Tiling, "acme-tiles", "2.1"),
        Registered(Kind.JUDGE, Weighing, "acme-pens", "1.3"),
        Registered(Kind.SIMILARITY, Alikeness, "acme-tiles", "2.1"),
        Registered(Kind.HISTOGRAM, Compass, "acme-pens", "1.3"),
    ],
    [
        PluginStatus("pens", "acme-pens", "1.3"),
        PluginStatus(
            "inks", "acme-inks", "0.4", PluginState.DISABLED, "the configuration denies it"
        ),
        PluginStatus(
            "rulers", "acme-rulers", "5.6", PluginState.FAILED, "No module named 'straight'"
        ),
    ],
    [RegisteredReader(Sheets, "acme-sheets", "7.5")],
)
DEFAULTS = Defaults(
    pipeline={"sketch_segmenter": Choice("tracing"), "judge": Choice("weighing")},
    parameters={
        Kind.SEGMENTER: {"tracing": {"closing": 0.375}},
        Kind.SEARCHER: {"guessing": {"rounds": 7}},
        Kind.JUDGE: {"weighing": {"strictness": 0.625}},
    },
    profiles=(
        Profile(
            "hasty",
            "Guesses once.",
            {"searcher": Choice("guessing"), "histogram": Choice("compass")},
        ),
        Profile(
            "careful",
            "Takes its time.",
            {
                "sketch_segmenter": Choice("tracing", {"closing": 0.125, "mode": "neat"}),
                "searcher": Choice("guessing", {"rounds": 9}),
                "judge": Choice("weighing"),
            },
            WEIGHTS,
            allow_unmatched=True,
        ),
    ),
    profile="hasty",
)


def plain(value: Any) -> Any:
    """Return a value of the engine without arrays and classes of its own, to be compared."""
    if isinstance(value, np.ndarray):
        return (str(value.dtype), value.tolist())
    if isinstance(value, dict | MappingProxyType):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        fields = {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
        return (type(value).__name__, fields)
    return value
