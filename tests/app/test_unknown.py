"""What a request holds that the contract does not know is refused, and never passed over."""

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.app.jobs import answers
from sketchmatch.app.orders import Order
from sketchmatch.app.packed import Packed
from sketchmatch.app.setup import Setup
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch_proto.v1.catalog_service_pb2 import GetServerInfoRequest
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.scene_service_pb2 import SegmentRequest
from tests.contract.golden import NAMES, golden


@pytest.fixture(scope="module")
def setup():
    return Setup(Engine(default_registry()))


NEWER = b"\xc2\x3e\x02hi"  # field 1000, a text
LIMIT = 1_000_000
REQUESTS = [name for name in NAMES if name.startswith(("MatchRequest", "SegmentRequest"))]


def refused(data: bytes, kind: str = "MatchRequest") -> InvalidInputError:
    with pytest.raises(InvalidInputError, match="with the number 1000,") as no:
        Order("m1", kind, data).job(LIMIT)
    assert no.value.reason is Reason.INVALID_FIELD
    return no.value


def with_newer(message: Message, *path: object) -> bytes:
    """Return a message encoded with an unknown field in the message at a path."""
    changed = type(message)()
    changed.CopyFrom(message)
    inner = changed
    for step in path:
        inner = inner[step] if isinstance(step, int) else getattr(inner, step)
    inner.MergeFromString(NEWER)
    return changed.SerializeToString()


@pytest.mark.parametrize("name", REQUESTS)
def test_what_the_contract_knows_is_let_through(name):
    message = golden(name)
    order = Order("m1", name.partition(".")[0], message.SerializeToString())
    assert order.job(LIMIT).request == message


@pytest.mark.parametrize(
    ("path", "field"),
    [
        ((), ""),
        (("sketch",), "sketch"),
        (("pipeline", "searcher"), "pipeline.searcher"),
        (
            ("sketch", "stroke_set", "strokes", 1, "points", 0),
            "sketch.stroke_set.strokes[1].points[0]",
        ),
        (("pipeline", "histogram", "parameters"), "pipeline.histogram.parameters"),
        (("pins", 2, "sketch_object"), "pins[2].sketch_object"),
    ],
)
def test_an_unknown_field_is_refused_with_its_path_and_number(path, field):
    assert refused(with_newer(golden("MatchRequest"), *path)).field == field


def test_an_unknown_field_of_a_parameter_is_refused_under_its_name():
    request = MatchRequest()
    request.pipeline.searcher.parameters["population"] = 3.0
    value = request.pipeline.searcher.parameters.fields["population"]
    value.MergeFromString(NEWER)
    no = refused(request.SerializeToString())
    assert no.field == 'pipeline.searcher.parameters.fields["population"]'


def test_every_request_of_the_contract_is_looked_through():
    assert refused(with_newer(SegmentRequest(), "segmenter"), "SegmentRequest").field == "segmenter"
    with pytest.raises(InvalidInputError, match=r"^the sketchmatch\.v1\.GetServerInfoRequest has "):
        Packed(NEWER, GetServerInfoRequest.FromString).opened(LIMIT)


def test_messages_of_other_packages_are_let_through():
    file = descriptor_pb2.FileDescriptorProto(name="other.proto", package="other", syntax="proto3")
    file.message_type.add(name="Empty")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    other = message_factory.GetMessageClass(pool.FindMessageTypeByName("other.Empty"))
    assert Packed(NEWER, other.FromString).opened(LIMIT).SerializeToString() == NEWER


@given(st.binary(max_size=40))
def test_what_is_let_through_says_all_that_came(data):
    try:
        request = Order("m1", "MatchRequest", data).job(LIMIT).request
    except InvalidInputError:
        return
    before = request.ByteSize()
    request.DiscardUnknownFields()
    assert request.ByteSize() == before


@pytest.mark.parametrize("inside", ["plain", "list", "struct"])
@pytest.mark.parametrize("kind", [MatchRequest, SegmentRequest])
def test_a_parameter_without_a_value_is_refused(setup, kind, inside):
    request = golden("MatchRequest.turned") if kind is MatchRequest else golden("SegmentRequest")
    stage = request.pipeline.searcher if kind is MatchRequest else request.segmenter
    blank = stage.parameters.fields["population"]
    if inside == "list":
        blank.list_value.values.add()
    elif inside == "struct":
        blank.struct_value.fields["size"].SetInParent()
    else:
        blank.SetInParent()
    job = Order("m1", kind.DESCRIPTOR.name, request.SerializeToString()).job(LIMIT)
    with pytest.raises(InvalidInputError, match="has no value; set one kind") as no:
        list(answers(job, setup))
    path = "pipeline.searcher" if kind is MatchRequest else "segmenter"
    assert no.value.field == f"{path}.parameters.population"


def test_a_null_is_a_value_and_no_parameters_are_none(setup):
    request = golden("MatchRequest.turned")
    request.pipeline.searcher.parameters.SetInParent()
    job = Order("m1", "MatchRequest", request.SerializeToString()).job(LIMIT)
    assert [*answers(job, setup)][-1].HasField("result")
    request.pipeline.searcher.parameters["population"] = None
    job = Order("m1", "MatchRequest", request.SerializeToString()).job(LIMIT)
    with pytest.raises(InvalidInputError) as no:
        list(answers(job, setup))
    assert no.value.reason is Reason.INVALID_PARAMETER


@pytest.mark.parametrize("kind", ["stroke_set", "polygon_set"])
def test_a_way_of_y_that_nobody_knows_is_refused(setup, kind):
    request = golden("MatchRequest" if kind == "stroke_set" else "MatchRequest.turned")
    getattr(request.sketch, kind).y_axis = 7
    job = Order("m1", "MatchRequest", request.SerializeToString()).job(LIMIT)
    with pytest.raises(InvalidInputError, match=r"is 7, .*; give Y_AXIS_UP or Y_AXIS_DOWN$") as no:
        list(answers(job, setup))
    assert (no.value.reason, no.value.field) == (Reason.INVALID_FIELD, f"sketch.{kind}.y_axis")


def test_a_priority_that_nobody_knows_is_refused(setup):
    request = golden("MatchRequest")
    request.priority = 9
    job = Order("m1", "MatchRequest", request.SerializeToString()).job(LIMIT)
    names = "PRIORITY_LOW or PRIORITY_NORMAL or PRIORITY_HIGH$"
    with pytest.raises(InvalidInputError, match=f"priority is 9, .*; give {names}") as no:
        list(answers(job, setup))
    assert (no.value.reason, no.value.field) == (Reason.INVALID_FIELD, "priority")
