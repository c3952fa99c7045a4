"""What can be told of a request before it is decoded."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.app.orders import Order
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch_client import (
    features,
    match_request,
    segment_request,
    sources,
    transfer_request,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest

SCENE = sources.polygons([[[0, 0], [2, 0], [2, 2], [0, 2]], [[5, 0], [9, 0], [9, 1]]])
LIMIT = 1_000_000
FILE = sources.file(b'{"boxes": []}', name="x.json", part="a")


@pytest.mark.parametrize(
    ("request_", "kinds"),
    [
        (match_request(SCENE, FILE, searcher="easm", time_budget=2.0), ("polygon_set", "file")),
        (match_request(sources.strokes([[[0, 0], [1, 1]]]), SCENE), ("stroke_set", "polygon_set")),
        (MatchRequest(seed=2**64 - 1), (None, None)),
    ],
)
def test_an_outline_has_all_but_what_sketch_and_map_hold(request_, kinds):
    order = Order("m1", "MatchRequest", request_.SerializeToString())
    outline = order.outline(LIMIT)
    assert outline.id == "m1"
    sides = (outline.request.sketch, outline.request.map)
    assert tuple(side.WhichOneof("kind") for side in sides) == kinds
    for side, whole in zip(sides, (request_.sketch, request_.map), strict=True):
        if side.WhichOneof("kind") == "file":
            assert side == whole
        else:
            assert side.ByteSize() <= 4
    for message in (outline.request, request_):
        message.ClearField("sketch")
        message.ClearField("map")
    assert outline.request == request_


def test_an_outline_of_a_segmentation_names_the_form_of_its_source():
    data = segment_request(SCENE, segmenter="polygons").SerializeToString()
    request = Order("", "SegmentRequest", data).outline(LIMIT).request
    assert request.source.WhichOneof("kind") == "polygon_set"
    assert not request.source.polygon_set.polygons
    assert request.segmenter.name == "polygons"


def test_an_outline_of_a_transfer_keeps_what_is_carried():
    whole = transfer_request(SCENE, FILE, [features.point(1, 2, "dock")], y_axis="down")
    request = Order("", "TransferRequest", whole.SerializeToString()).outline(LIMIT).request
    assert not request.sketch.polygon_set.polygons
    assert request.map == FILE
    assert request.features == whole.features
    assert request.y_axis == whole.y_axis


@given(st.binary(max_size=60))
def test_bytes_that_are_no_request_are_refused_as_a_whole_and_have_some_outline(data):
    order = Order("", "MatchRequest", data)
    assert isinstance(order.outline(LIMIT).request, MatchRequest)
    try:
        MatchRequest.FromString(data)
    except Exception:
        with pytest.raises(InvalidInputError, match="cannot be decoded") as no:
            order.job(LIMIT)
        assert (no.value.reason, no.value.field) == (Reason.INVALID_FIELD, "")
        return
    with suppress(InvalidInputError):  # of fields that are not the contract's
        assert order.job(LIMIT).request == MatchRequest.FromString(data)
