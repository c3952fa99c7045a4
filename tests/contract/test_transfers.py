"""The engine reads the golden requests to carry something, and writes the golden response."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sketchmatch.app.setup import RequestLimits
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.transfers.features import Carried, Change, ChangeReason, Feature, FeatureKind
from sketchmatch.transfers.transfer import Direction, TransferRequest, TransferResult
from sketchmatch.transfers.warp import WarpKind
from sketchmatch_proto.v1 import source_pb2, transfer_service_pb2
from tests.contract.conversions import requests, responses
from tests.contract.golden import as_json, as_written, golden
from tests.contract.values import MATCHES, RESULT, SEGMENTED, plain


def lines(*rings):
    return tuple(np.array(ring, dtype=float) for ring in rings)


POINT, ROUTE, ZONE = FeatureKind.POINT, FeatureKind.ROUTE, FeatureKind.ZONE
FEATURES = (
    Feature(POINT, lines([[1.25, 2.5]]), "dock"),
    Feature(
        ROUTE,
        lines([[3.5, -4.75], [5.25, -0.125], [9.5, 0.0]]),
        "patrol",
        np.array([0.5, 0.25, 0.75]),
    ),
    Feature(
        ZONE,
        lines(
            [[2, -12], [8, -12], [8, -20], [2, -20]],
            [[3, -17], [5, -17], [5, -13], [3, -13]],
        ),
        "no-go",
    ),
)
RESPONSE = TransferResult(
    carried=(
        Carried(
            ROUTE,
            "route",
            Feature(ROUTE, lines([[31, 1], [17.5, 9], [31.5, 21.5]]), "route"),
            lines([0.5, 0.25, 0.75]),
            lines([0, 0.625, 2]),
            (
                Change(
                    ChangeReason.OBSTACLE,
                    1,
                    2,
                    "Led around bar, to stay 0.375 m away from obstacles.",
                ),
            ),
        ),
        Carried(
            POINT,
            "dock",
            Feature(POINT, lines([[7.5, 2.25]]), "dock"),
            lines([0.125]),
            lines([0]),
            (Change(ChangeReason.BLOCKED, 0, 0, "It lies in an obstacle."),),
        ),
        Carried(
            ROUTE,
            "patrol",
            Feature(ROUTE, lines([[1, 2], [3, 4]]), "patrol", np.array([0.5, 0.75])),
            lines([0.25, 0.375]),
            lines([0, 1]),
        ),
        Carried(
            ZONE,
            "no-go",
            Feature(ZONE, lines([[2, 12], [8, 12], [8, 20]], [[6, 14], [7, 14], [7, 15]]), "no-go"),
            lines([0.5, 0.625, 0.875], [0.125, 0.375, 0.25]),
            lines([0, 1, 2], [0, 1, 2]),
        ),
        Carried(
            ROUTE,
            "attic",
            None,
            (),
            (),
            (Change(ChangeReason.UNREACHABLE, 0, 0, "All of it is blocked."),),
        ),
    ),
    drawn=1,
    warp=SimpleNamespace(
        kind=WarpKind.SPLINE,
        rotation=1.5,
        scale=2.25,
        residual=0.125,
        weights=np.array([0.5, 0.875]),
    ),
    object_map=((1, 3), (2, 0)),
    sketch=SEGMENTED.sketch,
    map=SEGMENTED.map,
    match=RESULT,
)


def read(name):
    return requests.transfer_request(golden(name), RequestLimits())


def test_a_request_is_read_field_by_field():
    expected = TransferRequest(
        match=replace(MATCHES["MatchRequest"], alternatives=None),
        features=FEATURES,
        direction=Direction.MAP_TO_SKETCH,
        radius=0.375,
    )
    assert plain(read("TransferRequest")) == plain(expected)


def test_what_is_known_is_read_in_place_of_a_match():
    request = read("TransferRequest.known")
    assert request.object_map == ((1, 0), (0, 2))
    assert (request.radius, request.allow_unknown) == (None, True)
    assert request.direction is Direction.SKETCH_TO_MAP
    assert plain(request.features) == plain((Feature(POINT, lines([[1.5, 2.5]])),))


def test_a_response_is_written_field_by_field():
    assert as_json(responses.transferred(RESPONSE)) == as_written("TransferResponse")


def test_every_kind_of_change_and_of_warp_has_a_name_in_the_contract():
    for kinds, enum, prefix in (
        (ChangeReason, transfer_service_pb2.ChangeReason, "CHANGE_REASON_"),
        (WarpKind, transfer_service_pb2.WarpKind, "WARP_KIND_"),
    ):
        named = {f"{prefix}{kind.name}" for kind in kinds}
        assert {*enum.keys()} == {f"{prefix}UNSPECIFIED", *named}


def point(x, y):
    return source_pb2.Point(x=x, y=y)


@pytest.mark.parametrize(
    ("feature", "field"),
    [
        ({}, "features[1]"),
        ({"point": point(np.nan, 0.0)}, "features[1].point"),
        ({"route": {"points": [point(0, 0)]}}, "features[1].route.points"),
        (
            {"route": {"points": [point(0, 0), point(1, 0)], "speeds_meters_per_second": [1.0]}},
            "features[1].route.speeds_meters_per_second",
        ),
        ({"zone": {}}, "features[1].zone.rings"),
        ({"zone": {"rings": [{"points": [point(0, 0)]}]}}, "features[1].zone.rings[0]"),
        (
            {"zone": {"rings": [{"points": [point(0, 0), point(1, 1), point(1, 0), point(0, 1)]}]}},
            "features[1].zone.rings",
        ),
    ],
)
def test_a_fault_of_a_feature_has_its_path(feature, field):
    request = golden("TransferRequest.known")
    request.features.append(transfer_service_pb2.Feature(**feature))
    with pytest.raises(InvalidInputError) as refused:
        requests.transfer_request(request, RequestLimits())
    assert refused.value.field == field
    assert refused.value.reason in (Reason.INVALID_FIELD, Reason.MISSING_FIELD)


def test_a_direction_that_is_none_is_refused():
    request = golden("TransferRequest.known")
    request.direction = 7
    with pytest.raises(InvalidInputError, match="direction is 7, which this server") as refused:
        requests.transfer_request(request, RequestLimits())
    assert refused.value.field == "direction"
