"""The client asks for what is to be carried, and returns what became of it."""

import pytest

from sketchmatch_client import InvalidRequestError, features, sources, transfer_request
from tests.client.test_golden import BAR, GRID, MATCHES, PICTURE, STROKES
from tests.contract.golden import golden

FEATURES = [
    features.point(1.25, -2.5, "dock"),
    features.route([(3.5, 4.75), (5.25, 0.125), (9.5, 0)], "patrol", [0.5, 0.25, 0.75]),
    features.zone(BAR, "no-go"),
]
OPTIONS = {
    **{name: value for name, value in MATCHES["MatchRequest"][2].items() if name != "alternatives"},
    "direction": "map-to-sketch",
    "y_axis": "down",
    "radius": 0.375,
}


def test_features_are_sent_with_all_that_a_match_takes(call, server):
    call(server.address, "transfer", STROKES, GRID, FEATURES, **OPTIONS)
    assert server.requests == [golden("TransferRequest")]


def test_a_known_object_map_is_sent_in_place_of_a_match(call, server):
    known = golden("TransferRequest.known")
    sketch = sources.polygons([[(1, 2), (4, 2), (4, 8)], [(5, 3), (9, 3), (9, 6)]])
    sketch.polygon_set.ClearField("y_axis")
    call(
        server.address,
        "transfer",
        sketch,
        sources.image(PICTURE),
        [features.point(1.5, 2.5)],
        object_map={1: 0, 0: 2},
        allow_unknown=True,
    )
    assert server.requests == [known]


def test_what_became_of_it_is_returned(call, server):
    server.transferred = golden("TransferResponse")
    assert call(server.address, "transfer", STROKES, GRID) == golden("TransferResponse")


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"object_map": [(0, 1)]}, "object_map"),
        ({"object_map": {0: -1}}, "object_map"),
        ({"object_map": {}}, "object_map"),  # which the contract cannot tell from none
        ({"direction": "back"}, "direction"),
        ({"y_axis": "left"}, "y_axis"),
        ({"radius": "wide"}, "radius"),
        ({"alternatives": 3}, "alternatives"),
        ({"request_id": "3f0e"}, "request_id"),
        ({"keep_running": True}, "keep_running"),
        ({"priority": "low"}, "priority"),
    ],
)
def test_an_option_of_the_wrong_form_is_refused_by_name(options, field):
    with pytest.raises(InvalidRequestError) as refused:
        transfer_request(STROKES, GRID, FEATURES, **options)
    assert refused.value.field == field


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: features.point("x", 0), "point"),
        (lambda: features.route([(0, 0), (1,)]), "route.points"),
        (lambda: features.route([(0, 0), (1, 1)], speeds=["fast"]), "route.speeds"),
        (lambda: features.route([]), "route.points"),
        (lambda: features.route(None), "route.points"),
        (lambda: features.zone([]), "zone.rings"),
        (lambda: features.zone([(0, 0), (1, 1), (2, 0)], name=3), "name"),
    ],
)
def test_a_feature_of_the_wrong_form_is_refused_by_name(make, field):
    with pytest.raises(InvalidRequestError) as refused:
        make()
    assert refused.value.field == field


def test_features_that_are_none_are_refused():
    with pytest.raises(InvalidRequestError, match=r"sketchmatch_client\.features makes"):
        transfer_request(STROKES, GRID, [(1, 2)])
