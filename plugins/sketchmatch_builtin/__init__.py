"""The algorithms and readers that come with sketchmatch, registered as any plugin's are.

Each hook imports its kind alone: listing one kind does not load the others.
"""

from __future__ import annotations

from sketchmatch.api import Histogram, Judge, Reader, Searcher, Segmenter, Similarity, hookimpl


@hookimpl
def sketchmatch_register_segmenters() -> list[type[Segmenter]]:
    """Offer the built-in segmenters."""
    from sketchmatch_builtin.segmenters.image import ImageSegmenter
    from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
    from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter
    from sketchmatch_builtin.segmenters.rooms import RoomSegmenter
    from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter

    return [
        PolygonSegmenter,
        StrokeSegmenter,
        OccupancyGridSegmenter,
        RoomSegmenter,
        ImageSegmenter,
    ]


@hookimpl
def sketchmatch_register_histograms() -> list[type[Histogram]]:
    """Offer the built-in histograms."""
    from sketchmatch_builtin.histograms.angles import Angles
    from sketchmatch_builtin.histograms.constant import ConstantForce
    from sketchmatch_builtin.histograms.force import Force
    from sketchmatch_builtin.histograms.gravitational import GravitationalForce
    from sketchmatch_builtin.histograms.hybrid import HybridForce
    from sketchmatch_builtin.histograms.raster import RasterForce

    return [ConstantForce, GravitationalForce, Force, HybridForce, RasterForce, Angles]


@hookimpl
def sketchmatch_register_similarities() -> list[type[Similarity]]:
    """Offer the built-in similarity measures."""
    from sketchmatch_builtin.similarities.circular_peak import CircularPeak
    from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
    from sketchmatch_builtin.similarities.overlap import Overlap
    from sketchmatch_builtin.similarities.pappis import Pappis
    from sketchmatch_builtin.similarities.santini_jain import SantiniJain

    return [CrossCorrelation, CircularPeak, Pappis, Overlap, SantiniJain]


@hookimpl
def sketchmatch_register_searchers() -> list[type[Searcher]]:
    """Offer the built-in searchers."""
    from sketchmatch_builtin.searchers.align import Align
    from sketchmatch_builtin.searchers.auto import Auto
    from sketchmatch_builtin.searchers.direct import Direct
    from sketchmatch_builtin.searchers.easm import Easm
    from sketchmatch_builtin.searchers.exact import Exact
    from sketchmatch_builtin.searchers.fsnn_pso import FsnnPso
    from sketchmatch_builtin.searchers.nn import Nn
    from sketchmatch_builtin.searchers.nn_pso import NnPso

    return [Align, Auto, Nn, NnPso, FsnnPso, Easm, Direct, Exact]


@hookimpl
def sketchmatch_register_judges() -> list[type[Judge]]:
    """Offer the built-in judges."""
    from sketchmatch_builtin.judges.confidence import HighestConfidence
    from sketchmatch_builtin.judges.posterior import Posterior

    return [HighestConfidence, Posterior]


@hookimpl
def sketchmatch_register_readers() -> list[type[Reader]]:
    """Offer the built-in readers."""
    from sketchmatch_builtin.readers.coco import CocoReader
    from sketchmatch_builtin.readers.cvat import CvatReader
    from sketchmatch_builtin.readers.dxf import DxfReader
    from sketchmatch_builtin.readers.excalidraw import ExcalidrawReader
    from sketchmatch_builtin.readers.labelme import LabelmeReader
    from sketchmatch_builtin.readers.scene_graph import SceneGraphReader

    return [
        ExcalidrawReader,
        LabelmeReader,
        CocoReader,
        CvatReader,
        DxfReader,
        SceneGraphReader,
    ]
