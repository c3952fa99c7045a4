"""``sketchmatch serve``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sketchmatch.cli.options import Config, say

if TYPE_CHECKING:
    from sketchmatch.app.setup import Setup
    from sketchmatch.config import Configuration
    from sketchmatch.server.serve import ServerSettings

__all__ = ["serve"]

_MIB = 1024 * 1024
_PATIENCE_SECONDS = 30.0
_WEB_ADDRESS = "127.0.0.1:8080"


def serve(
    config: Config = None,
    profile: Annotated[
        str | None,
        typer.Option("--profile", metavar="NAME", help="Profile for requests that name none."),
    ] = None,
    address: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="HOST:PORT or unix:PATH to listen on, 127.0.0.1:50051 by default; port 0 picks a "
            "free one.",
        ),
    ] = None,
    max_request_mib: Annotated[
        int | None, typer.Option(help="Largest request, in MiB; 64 by default.")
    ] = None,
    max_matches: Annotated[
        int | None,
        typer.Option(help="Requests at the same time; 4 per processor by default."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Minimum of worker processes, by default one per processor; 0 to answer in "
            "the server's own process, slower but with less memory."
        ),
    ] = None,
    max_waiting: Annotated[
        int | None, typer.Option(help="Requests waiting for their turn; 500 by default.")
    ] = None,
    max_waiting_mib: Annotated[
        int | None,
        typer.Option(help="Total size of waiting requests, in MiB; 256 by default."),
    ] = None,
    max_wait: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Longest wait for a turn; 10 by default."),
    ] = None,
    max_time_budget: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Longest match; 3600 by default.")
    ] = None,
    default_time_budget: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Longest match if the request does not say; 300 by default."
        ),
    ] = None,
    max_matches_per_caller: Annotated[
        int | None, typer.Option(help="Requests of one caller at the same time; further ones wait.")
    ] = None,
    max_requests_per_minute: Annotated[
        int | None, typer.Option(help="Requests that one caller may start per minute.")
    ] = None,
    max_stored_mib_per_caller: Annotated[
        int | None,
        typer.Option(
            metavar="MIB", help="Size of the scenes that one caller stores, with their sources."
        ),
    ] = None,
    max_comparisons: Annotated[
        int | None,
        typer.Option(
            help="Comparisons of a match: pairs of sketched objects × pairs of mapped objects × "
            "directions."
        ),
    ] = None,
    max_candidates: Annotated[
        int | None,
        typer.Option(
            help="Object maps that a search may evaluate by its parameters, such as population × "
            "generations."
        ),
    ] = None,
    grace: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Time for running matches at shutdown; 5 by default.",
        ),
    ] = None,
    max_bytes: Annotated[
        int | None,
        typer.Option(help="Bytes of one picture in a request; 256 MiB by default."),
    ] = None,
    max_pixels: Annotated[
        int | None, typer.Option(help="Pixels of a picture or grid; 64 million by default.")
    ] = None,
    max_side: Annotated[
        int | None,
        typer.Option(help="Pixels along a side of a picture or grid; 65535 by default."),
    ] = None,
    max_vertices: Annotated[
        int | None, typer.Option(help="Vertices of a sketch or map; 1 million by default.")
    ] = None,
    max_objects: Annotated[
        int | None, typer.Option(help="Objects of a scene; 1000 by default.")
    ] = None,
    tls_certificate: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Certificate of the server (PEM), for encrypted connections."
        ),
    ] = None,
    tls_key: Annotated[
        str | None, typer.Option(metavar="FILE", help="Private key of the certificate (PEM).")
    ] = None,
    tls_client_ca: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Certificate authorities of clients (PEM); each client must then show a "
            "certificate.",
        ),
    ] = None,
    tokens: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Token file written by `sketchmatch tokens add`; calls must carry one of its "
            "tokens.",
        ),
    ] = None,
    insecure: Annotated[
        bool,
        typer.Option(
            "--insecure",
            help="Allow an address that other machines reach, although anyone may then call or "
            "read along.",
        ),
    ] = False,
    store: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder for what the server keeps; by default in the user's folder for "
            "application state. Each server needs a folder of its own.",
        ),
    ] = None,
    no_store: Annotated[
        bool, typer.Option("--no-store", help="Keep nothing after the server stops.")
    ] = False,
    keep_matches_days: Annotated[
        float | None,
        typer.Option(metavar="DAYS", help="Time to keep a match after its end; 30 by default."),
    ] = None,
    keep_matches_mib: Annotated[
        int | None,
        typer.Option(help="Size limit of all kept matches, in MiB; 1024 by default."),
    ] = None,
    keep_scenes_mib: Annotated[
        int | None,
        typer.Option(help="Size limit of all stored scenes, in MiB; 1024 by default."),
    ] = None,
    max_sketches: Annotated[
        int | None,
        typer.Option(help="Sketches in progress at the same time; 1000 by default."),
    ] = None,
    max_sketches_per_caller: Annotated[
        int | None, typer.Option(help="Sketches in progress of one caller; 100 by default.")
    ] = None,
    sketch_idle: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Time to keep a sketch in progress that nobody draws or watches; 1800 by default.",
        ),
    ] = None,
    metrics_address: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve Prometheus metrics and health probes over HTTP here.",
        ),
    ] = None,
    traces_endpoint: Annotated[
        str | None,
        typer.Option(
            metavar="URL", help="Send OpenTelemetry traces to this collector, OTLP over gRPC."
        ),
    ] = None,
    web: Annotated[
        bool,
        typer.Option(
            "--web",
            help="Serve the sketch pad to browsers, at 127.0.0.1:8080 by default.",
        ),
    ] = False,
    web_address: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve the sketch pad and Connect, gRPC-Web and JSON here.",
        ),
    ] = None,
    web_robots: Annotated[
        str | None,
        typer.Option(
            metavar="URL,…",
            help="Let the sketch pad send routes to these ROS bridges, e.g. ws://robot.local:9090.",
        ),
    ] = None,
    strict_plugins: Annotated[
        bool,
        typer.Option(
            "--strict-plugins",
            help="Refuse to start if a plugin fails, a name is taken twice, or the configuration "
            "names something that does not exist.",
        ),
    ] = False,
) -> None:
    """Serve the gRPC API until SIGTERM or Ctrl-C.

    Options override the configuration. SIGHUP rereads the configuration except addresses, web
    origins, grace, workers, the endpoint of traces and the paths of certificate and token files,
    whose content is reread whenever it changes. Requests in progress keep the settings they began
    with. Health is NOT_SERVING until the kernels are compiled or loaded. A server that hangs exits
    with code 70 after 30 s: have its supervisor restart it.
    """
    import asyncio

    from sketchmatch.app.forking import prepare
    from sketchmatch.config import load

    flags = {
        "profile": profile,
        "plugins.strict": strict_plugins or None,
        "server.address": address,
        "server.grace_seconds": grace,
        "server.max_request_mib": max_request_mib,
        "server.max_matches": max_matches,
        "server.workers": workers,
        "server.max_waiting": max_waiting,
        "server.max_waiting_mib": max_waiting_mib,
        "server.max_wait_seconds": max_wait,
        "server.max_time_budget_seconds": max_time_budget,
        "server.default_time_budget_seconds": default_time_budget,
        "server.max_matches_per_caller": max_matches_per_caller,
        "server.max_requests_per_minute": max_requests_per_minute,
        "server.max_stored_mib_per_caller": max_stored_mib_per_caller,
        "server.max_comparisons": max_comparisons,
        "server.max_candidates": max_candidates,
        "server.tls_certificate": tls_certificate,
        "server.tls_key": tls_key,
        "server.tls_client_ca": tls_client_ca,
        "server.tokens": tokens,
        "server.insecure": insecure or None,
        "server.store": store,
        "server.keep": False if no_store else None,
        "server.keep_matches_days": keep_matches_days,
        "server.keep_matches_mib": keep_matches_mib,
        "server.keep_scenes_mib": keep_scenes_mib,
        "server.max_sketches": max_sketches,
        "server.max_sketches_per_caller": max_sketches_per_caller,
        "server.sketch_idle_seconds": sketch_idle,
        "server.metrics_address": metrics_address,
        "server.traces_endpoint": traces_endpoint,
        "server.web_address": web_address,
        "server.web_robots": web_robots,
        "limits.max_bytes": max_bytes,
        "limits.max_pixels": max_pixels,
        "limits.max_side": max_side,
        "limits.max_vertices": max_vertices,
        "limits.max_objects": max_objects,
    }
    if web and not load(config, flags).settings.server.web_address:
        flags["server.web_address"] = _WEB_ADDRESS
    settings = _server_settings(load(config, flags))
    if settings.workers:
        prepare()
    from sketchmatch.server.log import logging_to_standard_error
    from sketchmatch.server.serve import serve as serve_forever

    def setup() -> Setup:
        configuration = load(config, flags)
        if _server_settings(configuration) != settings:
            say(
                "addresses, server.grace_seconds, server.workers, what is kept and the names of "
                "files do not change before the server is started again"
            )
        return _setup(configuration)

    with logging_to_standard_error():
        asyncio.run(serve_forever(setup, settings, say))


def _server_settings(configuration: Configuration) -> ServerSettings:
    """Return how to serve."""
    from sketchmatch.errors import InvalidInputError, Reason
    from sketchmatch.pipeline.processors import usable_cpus
    from sketchmatch.server.serve import ServerSettings
    from sketchmatch.server.tls import TlsFiles

    server = configuration.settings.server
    files = (server.tls_certificate, server.tls_key)
    authorities = server.tls_client_ca
    if (any(files) or authorities) and not all(files):
        given = "tls_client_ca" if not any(files) else "tls_key" if files[1] else "tls_certificate"
        lacking = "tls_certificate" if not files[0] else "tls_key"
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            f"server.{given}",
            f"is set without server.{lacking}; give --tls-certificate and --tls-key together",
        )
    certificate, key = files
    return ServerSettings(
        server.address,
        server.grace_seconds,
        usable_cpus() if server.workers is None else server.workers,
        _PATIENCE_SECONDS,
        TlsFiles(Path(certificate), Path(key), Path(authorities) if authorities else None)
        if certificate and key
        else None,
        Path(server.tokens) if server.tokens else None,
        server.insecure,
        server.metrics_address,
        _store(server.store, server.keep),
        server.web_address,
        server.web_origins,
        bool(server.store),
        server.keep_matches_days,
        server.keep_matches_mib * _MIB,
        server.keep_scenes_mib * _MIB,
        server.traces_endpoint,
        server.web_robots,
    )


def _store(folder: str | None, keep: bool) -> Path | None:
    """Return where to keep things; None for nowhere."""
    from platformdirs import user_state_path

    if not keep:
        return None
    return Path(folder) if folder else user_state_path("sketchmatch", appauthor=False)


def _setup(configuration: Configuration) -> Setup:
    """Return what requests are answered with; plugins are looked for anew."""
    from sketchmatch.app.setup import Isolation, RequestLimits, Setup, SketchLimits
    from sketchmatch.config import idle_faults, refuse_faults
    from sketchmatch.errors import InvalidInputError
    from sketchmatch.pipeline.engine import Engine
    from sketchmatch.registry import discover

    registry = discover(rules=configuration.rules)
    if configuration.strict:
        registry.refuse_problems()
    refuse_faults(configuration, registry)
    for fault in idle_faults(configuration, registry):
        if configuration.strict:
            problem = f"{fault.problem}; correct it, or set plugins.strict to false"
            raise InvalidInputError(fault.reason, fault.field, problem)
        say(str(fault))
    server = configuration.settings.server
    stored = server.max_stored_mib_per_caller
    return Setup(
        Engine(registry, configuration.defaults, configuration.limits),
        RequestLimits(
            max_request_bytes=server.max_request_mib * _MIB,
            max_concurrent_matches=server.max_matches or RequestLimits.max_concurrent_matches,
            max_waiting=server.max_waiting,
            max_waiting_bytes=server.max_waiting_mib * _MIB,
            max_wait=server.max_wait_seconds,
            max_time_budget=server.max_time_budget_seconds,
            default_time_budget=server.default_time_budget_seconds,
            max_per_caller=server.max_matches_per_caller,
            max_per_minute=server.max_requests_per_minute,
            max_stored_bytes=stored and stored * _MIB,
            max_comparisons=server.max_comparisons,
            max_candidates=server.max_candidates,
            sketches=SketchLimits(
                server.max_sketches,
                server.max_sketches_per_caller,
                idle_seconds=server.sketch_idle_seconds,
            ),
        ),
        Isolation(configuration.trusted, configuration.patience),
    )
