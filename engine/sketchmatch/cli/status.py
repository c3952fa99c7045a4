"""``sketchmatch status``."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sketchmatch.cli import options, output
from sketchmatch.cli.output import answering
from sketchmatch.errors import counted

if TYPE_CHECKING:
    from sketchmatch_client import Client
    from sketchmatch_proto.v1.catalog_service_pb2 import (
        GetServerInfoResponse,
        ListAlgorithmsResponse,
        Plugin,
        ServerLimits,
    )

__all__ = ["status"]

_MIB = 1024 * 1024
_LIMITS = {
    "max_matches_per_caller": "requests of one caller at once",
    "max_requests_per_minute": "requests of one caller a minute",
    "max_comparisons": "comparisons a match",
    "max_candidates": "maps a search",
}
_UNITS = (("d", 86_400), ("h", 3_600), ("min", 60), ("s", 1))


@answering
@options.asking
def status(
    address: Annotated[
        str,
        typer.Argument(metavar="ADDRESS", help="Address of the server: HOST:PORT or unix:PATH."),
    ],
    access: options.Access = options.Access(),  # noqa: B008
    timeout: options.Timeout = 5.0,
    json: options.JsonDocument = False,
) -> None:
    """Show a server's version, limits and plugins, and which algorithms are ready.

    In a pipe, each line is a name and a text, separated by a tab.
    """
    from sketchmatch.cli.answering import client_of

    with client_of(address, "ADDRESS", access) as client:
        serving = client.is_serving(timeout=timeout)
        began = time.perf_counter()
        info = client.server_info(timeout=timeout)
        took = time.perf_counter() - began
        catalogue = client.algorithms(timeout=timeout)
        ready = _readiness(client, catalogue, timeout)
    if json:
        output.write_json(_document(address, serving, info, catalogue, ready))
        return
    lines = list(_lines(address, serving, took, info, catalogue, ready))
    width = max(len(name) for name, _ in lines)
    for name, text in lines:
        if output.for_people():
            output.write(f"{name:<{width}}  {output.clean(text)}\n")
        else:
            output.write_line(name, text)


def _readiness(
    client: Client, catalogue: ListAlgorithmsResponse, timeout: float
) -> dict[str, bool]:
    """Return whether each algorithm is ready, by the name that health knows."""
    from sketchmatch.cli.catalogue import kind
    from sketchmatch_client import InvalidRequestError

    names = [f"{kind(item)}/{item.name}" for item in catalogue.algorithms]
    found = {}
    for name in names:
        try:
            found[name] = client.is_serving(name, timeout=timeout)
        except InvalidRequestError:  # an older server knows of no algorithms
            continue
    return found


def _lines(
    address: str,
    serving: bool,
    took: float,
    info: GetServerInfoResponse,
    catalogue: ListAlgorithmsResponse,
    ready: dict[str, bool],
) -> Iterator[tuple[str, str]]:
    state = "SERVING" if serving else "NOT_SERVING"
    yield "server", f"{address}, {state}, answers in {1000 * took:.0f} ms"
    uptime = _duration(info.uptime.ToTimedelta().total_seconds())
    yield "version", f"sketchmatch {info.version}, {info.api_version}, up {uptime}"
    yield "limits", "; ".join(_limits(info.limits))
    cold = [name for name, warm in ready.items() if not warm]
    told = f", not ready: {', '.join(cold)}" if cold else ", all ready" if ready else ""
    yield "algorithms", f"{len(catalogue.algorithms)}{told}"
    for plugin in catalogue.plugins:
        yield "plugin", f"{plugin.distribution} {plugin.version}, {_state(plugin)}"


def _limits(limits: ServerLimits) -> Iterator[str]:
    if limits.HasField("max_concurrent_matches"):
        yield f"{counted(limits.max_concurrent_matches, 'request')} at once"
    if limits.HasField("max_request_bytes"):
        yield f"{limits.max_request_bytes / _MIB:g} MiB a request"
    if limits.HasField("max_objects"):
        yield f"{limits.max_objects} objects a scene"
    if limits.HasField("max_time_budget"):
        yield f"{_duration(limits.max_time_budget.ToTimedelta().total_seconds())} a match"
    if limits.HasField("default_time_budget"):
        usual = _duration(limits.default_time_budget.ToTimedelta().total_seconds())
        yield f"{usual} a match by default"
    for name, what in _LIMITS.items():
        if limits.HasField(name):  # type: ignore[arg-type]
            yield f"{getattr(limits, name)} {what}"


def _state(plugin: Plugin) -> str:
    from sketchmatch_proto.v1.catalog_service_pb2 import PluginState

    state = PluginState.Name(plugin.state).removeprefix("PLUGIN_STATE_").lower()
    return f"{state}: {plugin.reason}" if plugin.reason else state


def _duration(seconds: float) -> str:
    """Return a time in its two largest units.

    Examples
    --------
    >>> _duration(93_784), _duration(61), _duration(0.5)
    ('1 d 2 h', '1 min 1 s', '0.5 s')
    """
    if seconds < 60:
        return f"{seconds:.3g} s"
    left, parts = int(seconds), list[str]()
    for unit, size in _UNITS:
        count, left = divmod(left, size)
        if count or parts:
            parts.append(f"{count} {unit}")
    return " ".join(part for part in parts[:2] if not part.startswith("0 "))


def _document(
    address: str,
    serving: bool,
    info: GetServerInfoResponse,
    catalogue: ListAlgorithmsResponse,
    ready: dict[str, bool],
) -> dict[str, Any]:
    from google.protobuf.json_format import MessageToDict

    return {
        "address": address,
        "serving": serving,
        "ready": ready,
        "info": MessageToDict(info),
        "plugins": [MessageToDict(plugin) for plugin in catalogue.plugins],
    }
