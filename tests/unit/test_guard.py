"""What plugins return and raise is theirs to answer for, by name, whatever it is."""

import numpy as np
import pytest

from sketchmatch.api import Segmentation, Segmenter
from sketchmatch.errors import PluginError
from sketchmatch.model import LabelledPolygon, PolygonSet, Scene, SceneObject
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import Kind, Registered, Registry, default_registry

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
