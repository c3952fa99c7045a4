"""The reader of scene graphs as Hydra exports them."""

import json

import numpy as np
import pytest

from sketchmatch.api import InvalidInputError
from sketchmatch.model import SceneObject
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch_builtin.readers.scene_graph import SceneGraphReader

UPRIGHT = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}


def box(dimensions=(2, 1, 1), center=(5, 5, 1), kind="AABB", turn=None):
    return {
        "type": kind,
        "dimensions": dimensions,
        "world_P_center": center,
        "world_R_center": turn or UPRIGHT,
    }


def node(key, layer, name, bounding_box, **attributes):
    said = {2: "ObjectNodeAttributes", 3: "PlaceNodeAttributes", 4: "RoomNodeAttributes"}
    return {
        "id": key,
        "layer": layer,
        "attributes": {
            "type": said.get(layer, "NodeAttributes"),
            "name": name,
            "position": [0, 0, 0],
            "bounding_box": bounding_box,
            **attributes,
        },
    }


def read(*nodes, part="", edges=(), **more):
    graph = {
        "SPARK_DSG_header": {"version": {"major": 1, "minor": 1, "patch": 3}},
        "directed": False,
        "multigraph": False,
        "layer_ids": [2, 3, 4, 5],
        "nodes": nodes,
        "edges": [{"source": a, "target": b, "info": {}} for a, b in edges],
        **more,
    }
    return SceneGraphReader().read(json.dumps(graph).encode(), part)


def objects(found):
    made = [SceneObject.from_rings(polygon.rings, polygon.label) for polygon in found.polygons]
    return [(item.label, pytest.approx(item.area), item.polygon.bounds) for item in made]


def test_objects_are_their_boxes_seen_from_above():
    found = read(node(1, 2, "desk", box()), node(2, 2, "bed", box((1, 3, 1), (0, 0, 0))))
    assert objects(found) == [
        ("desk", 2.0, (4.0, 4.5, 6.0, 5.5)),
        ("bed", 3.0, (-0.5, -1.5, 0.5, 1.5)),
    ]
    assert found.notes == ()


def test_a_turned_box_is_turned():
    half = np.sqrt(0.5)
    quarter = {"w": half, "x": 0, "y": 0, "z": half}
    upended = {"w": half, "x": 0, "y": half, "z": 0}
    found = read(
        node(1, 2, "a", box(kind="RAABB", turn=quarter)),
        node(2, 2, "b", box((4, 1, 2), kind="OBB", turn=upended)),
        node(3, 2, "c", box(kind="AABB", turn=quarter)),
    )
    bounds = [SceneObject.from_rings(p.rings).polygon.bounds for p in found.polygons]
    assert bounds[0] == pytest.approx((4.5, 4.0, 5.5, 6.0))
    assert bounds[1] == pytest.approx((4.0, 4.5, 6.0, 5.5))
    assert bounds[2] == pytest.approx((4.0, 4.5, 6.0, 5.5))


def test_boxes_of_older_graphs_have_corners():
    upright = {"type": "AABB", "min": [1, 2, 0], "max": [3, 5, 1], "world_P_center": [9, 9, 9]}
    turned = {
        "type": "RAABB",
        "min": [-1, -2, 0],
        "max": [1, 2, 1],
        "world_P_center": [10, 20, 0],
        "world_R_center": UPRIGHT,
    }
    found = read(node(1, 2, "a", upright), node(2, 2, "b", turned))
    assert [item[2] for item in objects(found)] == [(1, 2, 3, 5), (9, 18, 11, 22)]


def test_an_object_without_a_box_is_left_out_with_a_note():
    found = read(
        node(1, 2, "a", {"type": "INVALID"}),
        node(2, 2, "b", {"type": None}),
        node(3, 2, "c", box()),
    )
    assert [polygon.label for polygon in found.polygons] == ["c"]
    assert found.notes == (
        "Left out because they enclose no area or are not objects: "
        "objects without a bounding box (2).",
    )


def test_rooms_are_read_where_they_are_chosen_or_there_is_nothing_else():
    desk, hall = node(1, 2, "desk", box()), node(9, 4, "hall", box((8, 9, 1)))
    assert [p.label for p in read(desk, hall).polygons] == ["desk"]
    assert read(desk, hall).notes == ("The graph also has rooms (1); FILE#rooms reads them.",)
    assert [p.label for p in read(desk, hall, part="rooms").polygons] == ["hall"]
    assert [p.label for p in read(desk, hall, part="objects,rooms").polygons] == ["desk", "hall"]
    assert [p.label for p in read(hall).polygons] == ["hall"]
    with pytest.raises(InvalidInputError, match="has no part 'walls'; choose objects, rooms"):
        read(desk, part="walls")


def test_a_room_without_a_box_is_what_its_places_cover():
    found = read(
        node(9, 4, "hall", {"type": "INVALID"}),
        node(20, 3, "", None, position=[0, 0, 1], distance=1.0),
        node(21, 3, "", None, position=[1, 0, 1], distance=1.0),
        node(22, 3, "", None, boundary=[[0, 0, 0], [3, 0, 0], [3, 0.5, 0], [0, 0.5, 0]]),
        node(23, 3, "", None, position=[50, 50, 0], distance=1.0),
        edges=[(9, 20), (21, 9), (9, 22), (20, 23)],
    )
    ((label, _, bounds),) = objects(found)
    assert label == "hall"
    assert bounds == pytest.approx((-1.0, -1.0, 3.0, 1.0), abs=0.01)


def test_names_are_those_of_the_class_where_a_node_has_only_a_symbol():
    spaces = {"labelspaces": {"_l2p0": [[3, "sofa"], [4, "lamp"]]}}
    found = read(
        node(1, 2, "O(0)", box(), semantic_label=3),
        node(2, 2, "", box(), semantic_label=4),
        node(3, 2, "my chair", box(), semantic_label=4),
        node(4, 2, "O12", box(), semantic_label=99),
        metadata=spaces,
    )
    assert [p.label for p in found.polygons] == ["sofa", "lamp", "my chair", "O12"]


def test_layers_are_told_by_the_graph_or_by_number():
    bare = {"id": 1, "layer": 2, "attributes": {"name": "a", "bounding_box": box()}}
    moved = {"id": 2, "layer": 7, "attributes": {"name": "b", "bounding_box": box()}}
    assert [p.label for p in read(bare, moved).polygons] == ["a"]
    for seven, two in ((7, 2), ({"layer": 7, "partition": 0}, {"layer": 2, "partition": 0})):
        found = read(bare, moved, layer_names={"OBJECTS": seven, "ROOMS": two, "AGENTS": 9})
        assert [p.label for p in found.polygons] == ["b"]


@pytest.mark.parametrize(
    ("nodes", "words"),
    [
        ([3], "nodes[0] is 3; give a node"),
        ([{"id": 1}], "nodes[0].attributes is missing; give the node's attributes"),
        ([node(1, 2, "a", box([1, 2]))], "bounding_box.dimensions is a list of 2; give [x, y, z]"),
        (
            [node(1, 2, "a", box(kind="OBB", turn={"w": 0, "x": 0, "y": 0, "z": 0}))],
            "world_R_center is not a rotation; give a unit quaternion",
        ),
    ],
)
def test_a_fault_is_named_with_its_path_and_the_remedy(nodes, words):
    with pytest.raises(InvalidInputError) as caught:
        read(*nodes)
    assert words in str(caught.value)


def test_an_edge_said_often_is_one_edge():
    place = {"id": 2, "layer": 3, "attributes": {"position": [0, 0, 0], "distance": 1}}
    room = {"id": 1, "layer": 4, "attributes": {"name": "hall"}}
    edges = [{"source": 1, "target": 2}] * 100
    document = {"layer_ids": [3, 4], "nodes": [room, place], "edges": edges}
    with limited_to(SourceLimits(max_vertices=200)):
        found = SceneGraphReader().read(json.dumps(document, separators=(",", ":")).encode())
    assert [polygon.label for polygon in found.polygons] == ["hall"]
