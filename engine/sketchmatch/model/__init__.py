"""The values that flow through a match: immutable, and easy to build by hand in a test."""

from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray
from sketchmatch.model.maps import (
    Confidence,
    ConfidenceWeights,
    Fmap,
    ObjectMap,
    Occm,
    RequestWeights,
    Weights,
)
from sketchmatch.model.relations import (
    DILATION_SCALE,
    Pairs,
    RelationTable,
    SceneDescriptor,
    correspondences,
    object_pairs,
    pair_count,
    pair_index,
)
from sketchmatch.model.scene import Edges, Scene, SceneObject
from sketchmatch.model.sources import (
    GridPicture,
    Image,
    LabelledPolygon,
    Landmark,
    OccupancyGrid,
    PolygonSet,
    Source,
    Stroke,
    StrokeSet,
)

__all__ = [
    "DILATION_SCALE",
    "BoolArray",
    "Confidence",
    "ConfidenceWeights",
    "Edges",
    "FloatArray",
    "Fmap",
    "GridPicture",
    "Image",
    "IntArray",
    "LabelledPolygon",
    "Landmark",
    "ObjectMap",
    "Occm",
    "OccupancyGrid",
    "Pairs",
    "PolygonSet",
    "RelationTable",
    "RequestWeights",
    "Scene",
    "SceneDescriptor",
    "SceneObject",
    "Source",
    "Stroke",
    "StrokeSet",
    "Weights",
    "correspondences",
    "object_pairs",
    "pair_count",
    "pair_index",
]
