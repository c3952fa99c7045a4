"""Fields of a request that this server's contract does not have, which must not be passed over."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from google.protobuf.message import Message
from google.protobuf.unknown_fields import UnknownFieldSet

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["read_whole"]

_OURS = "sketchmatch."


def read_whole(read: Callable[[bytes], Message], data: bytes) -> Message:
    """Decode a message of the contract, unless it holds what the contract does not.

    Protobuf keeps such fields aside and says nothing: an option of a newer contract, or one that
    was encoded by hand under a wrong number, would be ignored and the answer be another one than
    was asked for. Messages of other packages, such as health, are let through.

    Raises
    ------
    InvalidInputError
        With the path of the message that has the field, and the field's number.
    """
    known = read(data)
    if not known.DESCRIPTOR.full_name.startswith(_OURS):
        return known
    size = known.ByteSize()
    known.DiscardUnknownFields()
    if known.ByteSize() == size:
        return known
    message = read(data)
    path, number = _first_unknown(message, known)
    name = message.DESCRIPTOR.full_name
    raise InvalidInputError(
        Reason.INVALID_FIELD,
        path,
        f"{'' if path else f'the {name} '}has a field with the number {number}, which is not in "
        "this server's contract; leave it out, write its name as in the .proto files, or use a "
        "newer server",
    )


def _first_unknown(message: Message, known: Message) -> tuple[str, int]:
    """Return where the first unknown field is; ``known`` is the message without such fields."""
    found = UnknownFieldSet(message)
    if len(found):
        return "", found[0].field_number
    for (path, inner), (_, rest) in zip(_messages(message), _messages(known), strict=True):
        if inner.ByteSize() != rest.ByteSize():
            below, number = _first_unknown(inner, rest)
            return f"{path}.{below}".removesuffix("."), number
    raise AssertionError(message.DESCRIPTOR.full_name)


def _messages(message: Message) -> Iterator[tuple[str, Message]]:
    """Yield the messages within a message, each with its path."""
    for field, value in message.ListFields():
        if field.message_type is None:
            continue
        if isinstance(value, Message):
            yield field.name, value
        elif field.message_type.GetOptions().map_entry:
            yield from ((f'{field.name}["{key}"]', value[key]) for key in sorted(value))
        else:
            yield from ((f"{field.name}[{k}]", item) for k, item in enumerate(value))
