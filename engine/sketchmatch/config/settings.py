"""All settings there are, with their defaults, bounds and meanings: the one list of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Self, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, create_model
from pydantic_settings import (
    BaseSettings,
    InitSettingsSource,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

from sketchmatch.api._numbers import Plain
from sketchmatch.config.addresses import address_fault, bridge_fault, network_fault
from sketchmatch.model.limits import SourceLimits
from sketchmatch.model.maps import MAX_DISTANCE, MAX_WEIGHT, WEIGHT_COUNTS
from sketchmatch.pipeline.selection import STAGES

__all__ = ["KEPT_MIB", "Settings", "annotation_of", "keys_of", "static_paths"]

KEPT_MIB = 1024
"""Most that kept matches may take, and kept scenes, where nobody says another number."""

Path = tuple[str, ...]
"""Where a setting is, e.g. ``("server", "address")``."""


def _listed(value: Any) -> Any:
    """Take ``a,b`` for a list, which is easier to write into an environment variable."""
    if isinstance(value, str):
        return [part.strip() for part in value.split(",") if part.strip()]
    return value


def _weighing(weights: tuple[float, ...]) -> tuple[float, ...]:
    if len(weights) not in WEIGHT_COUNTS or not sum(weights[:5]):
        raise ValueError("should be three, five or six numbers, the first five not all 0")
    if any(exponent > MAX_DISTANCE for exponent in weights[5:]):
        raise ValueError(f"should have an exponent of distance of at most {MAX_DISTANCE:g}")
    return weights


def _listening(address: str) -> str:
    if fault := address_fault(address):
        raise ValueError(fault)
    return address


def _watched(address: str | None) -> str | None:
    if address and (fault := network_fault(address)):
        raise ValueError(fault)
    return address


def _bridges(addresses: tuple[str, ...]) -> tuple[str, ...]:
    for address in addresses:
        if fault := bridge_fault(address):
            raise ValueError(fault)
    return addresses


_Weight = Annotated[float, Field(ge=0.0, le=MAX_WEIGHT)]
_Weights = Annotated[tuple[_Weight, ...], AfterValidator(_weighing)]
_Names = Annotated[tuple[str, ...], BeforeValidator(_listed)]
_Parameters = dict[str, Any]
_Named = dict[str, _Parameters]


class _Stage(Plain):
    """The algorithm of one stage."""

    name: str = Field("", description="Name of the algorithm.")
    parameters: _Parameters = Field({}, description="Values of some of its parameters.")


_EACH_STAGE: dict[str, Any] = {stage: (_Stage, _Stage()) for stage in STAGES}
_Stages: Any = create_model("_Stages", __base__=Plain, **_EACH_STAGE)


class _Pipeline(_Stages):
    """The algorithm of each stage of a match, if neither request nor profile chooses one."""


class _Profile(_Stages):
    """A pipeline that a request can name."""

    summary: str = Field("", description="One line for lists.")
    weights: _Weights | None = Field(
        None,
        description="Weights in ζ: of ζσ, ζR and ζL; optionally of the objects' shapes and sizes; "
        "optionally the exponent of distance in ζR. 1, 1, 1 by default.",
    )
    allow_unmatched: bool | None = Field(
        None,
        description="Let objects of either side stay without partner where that is more likely; by "
        "default as searcher and judge do.",
    )


class _Algorithms(Plain):
    """Parameters of an algorithm, wherever it is chosen."""

    segmenter: _Named = Field({})
    histogram: _Named = Field({})
    similarity: _Named = Field({})
    searcher: _Named = Field({})
    judge: _Named = Field({})


class _Plugins(Plain):
    """Which plugins may be used, and how far they are trusted. All are named by distribution."""

    allow: _Names | None = Field(
        None,
        description="Distributions whose plugins may be used, in addition to the engine's own; all "
        "by default.",
        examples=[["acme-search"]],
    )
    deny: _Names = Field((), description="Distributions whose plugins may not be used.")
    strict: bool = Field(
        False,
        description="Refuse to start a server if a plugin fails, a name is taken twice, or the "
        "configuration names something that does not exist.",
    )
    trusted: _Names = Field(
        (),
        description="Distributions whose algorithms run in the server process instead of separate "
        'ones; "*" for all.',
    )
    patience_seconds: float = Field(
        30.0,
        gt=0,
        description="Longest time that an algorithm in a separate process may show no sign of "
        "life.",
    )


class _Server(Plain):
    """Addresses, access and limits of `sketchmatch serve`."""

    address: Annotated[str, AfterValidator(_listening)] = Field(
        "127.0.0.1:50051",
        description="Host and port to listen on, or unix:PATH; port 0 picks a free one.",
    )
    grace_seconds: float = Field(5.0, ge=0, description="Time for running matches at shutdown.")
    max_request_mib: int = Field(64, ge=1, le=500, description="Largest request, in MiB.")
    max_matches: int | None = Field(
        None,
        ge=1,
        le=1000,
        description="Requests at the same time; 4 per processor by default.",
        examples=[8],
    )
    workers: int | None = Field(
        None,
        ge=0,
        le=1000,
        description="Minimum of worker processes, more start while more matches run; 0 to answer "
        "in the server's own process, slower but with less memory; one per processor by default.",
        examples=[2],
    )
    max_waiting: int = Field(
        500,
        ge=0,
        le=100_000,
        description="Requests waiting for their turn.",
    )
    max_waiting_mib: int = Field(
        256,
        ge=1,
        le=1_000_000,
        description="Total size of waiting requests, in MiB.",
    )
    max_wait_seconds: float = Field(
        10.0, ge=0, description="How long a request may wait for its turn."
    )
    max_time_budget_seconds: float = Field(
        3600.0, ge=0.001, description="Longest match; a request for more is cut to it."
    )
    default_time_budget_seconds: float = Field(
        300.0, ge=0.001, description="Longest match if the request does not say."
    )
    max_matches_per_caller: int | None = Field(
        None,
        ge=1,
        le=1000,
        description="Requests of one caller at the same time, further ones wait; no separate limit "
        "by default.",
        examples=[4],
    )
    max_requests_per_minute: int | None = Field(
        None,
        ge=1,
        le=1_000_000,
        description="Requests that one caller may start per minute; no limit by default.",
        examples=[600],
    )
    max_stored_mib_per_caller: int | None = Field(
        None,
        ge=1,
        le=1_000_000,
        description="Size of the scenes that one caller stores, with their sources, in MiB; by "
        "default limited only by the store.",
        examples=[100],
    )
    max_comparisons: int | None = Field(
        None,
        ge=1,
        le=10**15,
        description="Comparisons of one match: pairs of sketched objects × pairs of mapped objects "
        "× directions; by default limited only by memory.",
        examples=[1_000_000_000],
    )
    max_candidates: int | None = Field(
        None,
        ge=1,
        le=10**15,
        description="Object maps that a search may evaluate by its parameters, such as population "
        "× generations or particles × iterations; no limit by default.",
        examples=[100_000_000],
    )
    tls_certificate: str | None = Field(
        None,
        description="PEM file of the server's certificate and its intermediate certificates; no "
        "encryption by default.",
        examples=["server.pem"],
    )
    tls_key: str | None = Field(
        None, description="PEM file of the certificate's private key.", examples=["server.key"]
    )
    tls_client_ca: str | None = Field(
        None,
        description="PEM file of certificate authorities: each client must show a certificate of "
        "one of them; clients need none by default.",
        examples=["clients-ca.pem"],
    )
    tokens: str | None = Field(
        None,
        description="Token file written by `sketchmatch tokens add`: each call must carry one of "
        "its tokens; calls need none by default.",
        examples=["tokens"],
    )
    store: str | None = Field(
        None,
        description="Folder for what the server keeps, not shared with other servers; by default "
        "in the user's folder for application state.",
        examples=["/var/lib/sketchmatch"],
    )
    keep: bool = Field(True, description="Keep things on disk after the server stops.")
    keep_matches_days: float = Field(
        30.0, gt=0, le=36_500, description="Time to keep a match after its end."
    )
    keep_matches_mib: int = Field(
        KEPT_MIB,
        ge=1,
        le=1_000_000,
        description="Size limit of all kept matches, in MiB; the oldest are deleted first.",
    )
    keep_scenes_mib: int = Field(
        KEPT_MIB,
        ge=1,
        le=1_000_000,
        description="Size limit of all stored scenes, in MiB; what does not fit is refused.",
    )
    max_sketches: int = Field(
        1000, ge=0, le=1_000_000, description="Sketches in progress at the same time."
    )
    max_sketches_per_caller: int = Field(
        100, ge=0, le=1_000_000, description="Sketches in progress of one caller."
    )
    sketch_idle_seconds: float = Field(
        1800.0,
        gt=0,
        description="Time to keep a sketch in progress that nobody draws or watches.",
    )
    metrics_address: Annotated[str | None, AfterValidator(_watched)] = Field(
        None,
        description="Host and port for Prometheus' /metrics and the probes /livez and /readyz over "
        "HTTP; none by default.",
        examples=["127.0.0.1:9464"],
    )
    traces_endpoint: str | None = Field(
        None,
        pattern=r"^https?://[^/\s]+$",
        description="URL of an OpenTelemetry collector that takes OTLP over gRPC; no traces by "
        "default.",
        examples=["http://127.0.0.1:4317"],
    )
    web_address: Annotated[str | None, AfterValidator(_watched)] = Field(
        None,
        description="Host and port for browsers: the sketch pad, and the services over Connect, "
        "gRPC-Web and JSON; none by default.",
        examples=["127.0.0.1:8080"],
    )
    web_origins: _Names = Field(
        (),
        description="Origins of other pages that may call the address for browsers.",
        examples=[["https://pad.example.org"]],
    )
    web_robots: Annotated[_Names, AfterValidator(_bridges)] = Field(
        (),
        description="ROS bridges (rosbridge) to which the sketch pad may send routes; it connects "
        "to nothing else.",
        examples=[["ws://robot.local:9090"]],
    )
    insecure: bool = Field(
        False,
        description="Allow an address that other machines reach, although anyone may then call or "
        "read along.",
    )


class _Limits(Plain):
    """Largest sketch or map, in a file or in a request."""

    max_bytes: int = Field(
        SourceLimits.max_bytes, ge=1, description="Bytes of a file, or of a picture in a request."
    )
    max_pixels: int = Field(
        SourceLimits.max_pixels, ge=1, description="Pixels of a picture, cells of a grid."
    )
    max_side: int = Field(
        SourceLimits.max_side, ge=1, description="Pixels along a side of a picture or grid."
    )
    max_vertices: int = Field(
        SourceLimits.max_vertices, ge=1, description="Points of all strokes or polygons together."
    )
    max_objects: int = Field(SourceLimits.max_objects, ge=2, description="Objects of a scene.")


class Settings(BaseSettings):
    """A configuration as a file spells it, with all layers merged."""

    model_config = SettingsConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    profile: str = Field(
        "", description="Profile for requests that name none; empty for none.", examples=["proof"]
    )
    pipeline: _Pipeline = _Pipeline()
    algorithms: _Algorithms = _Algorithms()
    profiles: dict[Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")], _Profile] = {}
    plugins: _Plugins = _Plugins()
    server: _Server = _Server()
    limits: _Limits = _Limits()

    @classmethod
    def of(cls, layers: Iterable[Mapping[str, Any]]) -> Self:
        """Merge layers of values, the strongest first.

        Raises
        ------
        ValidationError
            If there are unknown keys or values of no use.
        """
        return cls(layers=tuple(layers))  # type: ignore[call-arg]

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Take the layers that :meth:`of` was given, and nothing else."""
        del env_settings, dotenv_settings, file_secret_settings
        assert isinstance(init_settings, InitSettingsSource)
        layers = init_settings.init_kwargs["layers"]
        return tuple(InitSettingsSource(settings_cls, layer) for layer in layers)


def annotation_of(path: Path) -> Any:
    """Return the type of what is at a path, or None where there can be nothing.

    Examples
    --------
    >>> annotation_of(("server", "address")), annotation_of(("server", "adress"))
    (<class 'str'>, None)
    """
    found: Any = Settings
    for part in path:
        if isinstance(found, type) and issubclass(found, BaseModel):
            field = found.model_fields.get(part)
            found = None if field is None else field.annotation
        elif get_origin(found) is dict:
            found = get_args(found)[1]
        else:
            return Any if found is Any else None
    return found


def keys_of(path: Path) -> tuple[str, ...]:
    """Return the keys that the table at a path can have; none where they are free."""
    found = annotation_of(path)
    if isinstance(found, type) and issubclass(found, BaseModel):
        return tuple(found.model_fields)
    return ()


def static_paths(path: Path = ()) -> Iterator[Path]:
    """Yield the paths of all settings below a path that need no free names."""
    for key in keys_of(path):
        below = (*path, key)
        if keys_of(below):
            yield from static_paths(below)
        elif get_origin(annotation_of(below)) is not dict:
            yield below
