"""From plain Python values to requests about scenes that a server keeps."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any

from sketchmatch_client._requests import segment_request
from sketchmatch_client.errors import InvalidRequestError, refused_as
from sketchmatch_proto.v1.scene_service_pb2 import (
    DeleteSceneRequest,
    GetSceneRequest,
    ObjectLabel,
    PutSceneRequest,
    UpdateSceneRequest,
)
from sketchmatch_proto.v1.source_pb2 import Source

__all__ = ["delete_request", "get_request", "put_request", "update_request"]


def put_request(
    source: Source,
    segmenter: str | None = None,
    params: Mapping[str, Any] | None = None,
    profile: str | None = None,
    title: str = "",
) -> PutSceneRequest:
    """Return the request to keep a scene; see :meth:`Client.put_scene`."""
    asked = segment_request(source, segmenter, params, profile)
    return PutSceneRequest(
        source=asked.source,
        segmenter=asked.segmenter if asked.HasField("segmenter") else None,
        profile=asked.profile,
        title=_title(title),
    )


def get_request(name: str, include_source: bool) -> GetSceneRequest:
    """Return the request for a scene; see :meth:`Client.get_scene`."""
    return GetSceneRequest(name=_name(name), include_source=include_source)


def update_request(
    name: str, labels: Mapping[int, str] | None, title: str | None = None
) -> UpdateSceneRequest:
    """Return the request for other labels or another title; see :meth:`Client.update_scene`."""
    labels = {} if labels is None else labels
    if not isinstance(labels, Mapping):
        problem = f"labels is {reprlib.repr(labels)}; give a dict from objects to labels"
        raise InvalidRequestError(problem, "INVALID_FIELD", "labels")
    with refused_as("INVALID_FIELD", "labels", "is not a dict from indices, from 0, to text"):
        given = [ObjectLabel(object=k, label=label) for k, label in labels.items()]
    called = None if title is None else _title(title)
    return UpdateSceneRequest(name=_name(name), labels=given, title=called)


def delete_request(name: str) -> DeleteSceneRequest:
    """Return the request to forget a scene; see :meth:`Client.delete_scene`."""
    return DeleteSceneRequest(name=_name(name))


def _title(given: Any) -> str:
    if not isinstance(given, str):
        problem = f"title is {reprlib.repr(given)}; give text by which people know the scene"
        raise InvalidRequestError(problem, "INVALID_FIELD", "title")
    return given


def _name(given: Any) -> str:
    if not isinstance(given, str):
        problem = f"name is {reprlib.repr(given)}; give the name of a stored scene"
        raise InvalidRequestError(problem, "INVALID_FIELD", "name")
    return given
