"""The golden messages cover the contract, and hide no exchange of two of its fields."""

import itertools
from collections import defaultdict

import pytest
from google.protobuf.message import Message

from tests.contract.golden import FILES, NAMES, as_json, as_written, golden


def types(described):
    """Yield a file's or a message's types of messages, those within others too."""
    inner = described.nested_types if hasattr(described, "nested_types") else None
    for kind in described.message_types_by_name.values() if inner is None else inner:
        yield kind
        yield from types(kind)


def form(field):
    """Return what a field takes."""
    return field.type, field.message_type, field.enum_type


TYPES = {kind.full_name: kind for file in FILES for kind in types(file)}
FIELDS = [field for kind in TYPES.values() for field in kind.fields]
TWINS = [
    (first, second)
    for kind in TYPES.values()
    for first, second in itertools.combinations(kind.fields, 2)
    if form(first) == form(second)
]
"""Fields of one message that take the same values, and so might be exchanged unseen."""


def parts(message: Message):
    """Yield a message and all within it that the contract defines."""
    if message.DESCRIPTOR.full_name not in TYPES:
        return
    yield message
    for field, value in message.ListFields():
        if field.message_type is not None:
            for part in [value] if isinstance(value, Message) else value:
                yield from parts(part)


@pytest.fixture(scope="module")
def found() -> dict[str, list[Message]]:
    """Every message within the golden ones, by type."""
    by_type = defaultdict(list)
    for name in NAMES:
        for part in parts(golden(name)):
            by_type[part.DESCRIPTOR.full_name].append(part)
    return by_type


@pytest.mark.parametrize("name", NAMES)
def test_each_is_the_json_that_protobuf_itself_writes(name):
    assert as_json(golden(name)) == as_written(name)


def test_every_request_and_response_has_a_file():
    methods = [
        method
        for file in FILES
        for service in file.services_by_name.values()
        for method in service.methods
    ]
    sent = {kind.name for method in methods for kind in (method.input_type, method.output_type)}
    assert len(methods) == 8
    assert sent <= {name.split(".")[0] for name in NAMES}


@pytest.mark.parametrize("full_name", TYPES)
def test_every_message_of_the_contract_stands_in_one(full_name, found):
    assert found[full_name]


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.full_name)
def test_every_field_is_set_in_one_to_what_is_not_its_default(field, found):
    messages = found[field.containing_type.full_name]
    values = [dict(message.ListFields()).get(field) for message in messages]
    assert any(isinstance(value, Message) or value for value in values)


@pytest.mark.parametrize("twins", TWINS, ids=lambda twins: f"{twins[0].full_name}-{twins[1].name}")
def test_fields_that_might_be_exchanged_differ_in_one(twins, found):
    first, second = (field.name for field in twins)
    messages = found[twins[0].containing_type.full_name]
    assert any(getattr(message, first) != getattr(message, second) for message in messages)
