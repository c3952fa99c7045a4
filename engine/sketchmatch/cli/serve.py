"""``sketchmatch serve``."""

from __future__ import annotations

from typing import Annotated

import typer

from sketchmatch.cli.options import say

__all__ = ["serve"]

_MIB = 1024 * 1024


def serve(
    address: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Where to listen; port 0 picks a free one.")
    ] = "127.0.0.1:50051",
    max_request_mib: Annotated[
        int, typer.Option(min=1, max=500, help="Largest request, in MiB.")
    ] = 64,
    max_matches: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Requests at the same time; 4 a processor by default."),
    ] = None,
    max_time_budget: Annotated[
        float | None,
        typer.Option(min=0.001, metavar="SECONDS", help="Longest match; no limit by default."),
    ] = None,
    grace: Annotated[
        float,
        typer.Option(min=0, metavar="SECONDS", help="Time for running matches when stopped."),
    ] = 5.0,
    max_bytes: Annotated[
        int | None,
        typer.Option(min=1, help="Bytes of one picture in a request; 256 MiB by default."),
    ] = None,
    max_pixels: Annotated[
        int | None,
        typer.Option(min=1, help="Pixels of a picture or grid; 64 million by default."),
    ] = None,
    max_side: Annotated[
        int | None,
        typer.Option(min=1, help="Pixels along a side of a picture or grid; 65535 by default."),
    ] = None,
    max_vertices: Annotated[
        int | None,
        typer.Option(min=1, help="Vertices of a sketch or map; 1 million by default."),
    ] = None,
    max_objects: Annotated[
        int | None, typer.Option(min=2, help="Objects of a scene; 1000 by default.")
    ] = None,
) -> None:
    """Serve the gRPC API until SIGTERM or Ctrl-C.

    Health is NOT_SERVING until the kernels are compiled or loaded. There is no encryption and no
    authentication yet: listen on addresses that only trusted programs reach. Where no option says
    how large a source may be, SKETCHMATCH_MAX_BYTES, …_PIXELS, …_SIDE, …_VERTICES and …_OBJECTS
    do.
    """
    import asyncio
    from dataclasses import replace

    from sketchmatch.model.limits import SourceLimits
    from sketchmatch.registry import default_registry
    from sketchmatch.server.limits import Limits
    from sketchmatch.server.serve import ServerSettings
    from sketchmatch.server.serve import serve as serve_forever

    defaults = Limits()
    sizes = {
        "max_bytes": max_bytes,
        "max_pixels": max_pixels,
        "max_side": max_side,
        "max_vertices": max_vertices,
        "max_objects": max_objects,
    }
    chosen = {name: value for name, value in sizes.items() if value is not None}
    limits = Limits(
        max_request_bytes=max_request_mib * _MIB,
        max_concurrent_matches=max_matches or defaults.max_concurrent_matches,
        max_time_budget=max_time_budget,
        sources=replace(SourceLimits.from_environment(), **chosen),
    )
    settings = ServerSettings(address=address, grace=grace, limits=limits)
    asyncio.run(serve_forever(default_registry(), settings, say))
