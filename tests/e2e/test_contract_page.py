"""The page of the contract: how it is changed, and what an error looks like."""

import math
import os
import shutil
import sys
from pathlib import Path

import grpc
import pytest
from google.rpc import error_details_pb2, status_pb2

from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from tests.environment import said_by
from tests.pages import Page
from tests.tools import ROOT, tool

pytestmark = pytest.mark.slow

PAGE = Page("proto/README.md", __name__)
CHANGES = [PAGE.take_one("sh", part) for part in ("make proto", "pip install", "buf build")]
ERROR = PAGE.take_one("", "INVALID_ARGUMENT")
GENERATED = Path("clients/python/sketchmatch_proto/v1")


def test_its_commands_make_what_is_checked_in(tmp_path):
    tool("python")  # for another Python the generator may have no wheel
    for name in ("proto", str(GENERATED)):
        shutil.copytree(ROOT / name, tmp_path / name)
    shutil.copy(ROOT / "Makefile", tmp_path)
    made = tmp_path / GENERATED
    checked_in = contents(made)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    *generate, release = CHANGES
    for block in generate:
        for file in made.glob("*_pb2*"):
            file.unlink()
        said_by("bash", "-ec", block.text, cwd=tmp_path, PATH=path, PIP_CONSTRAINT="")
        assert contents(made) == checked_in
    released = tmp_path / "proto" / "released.binpb"
    released.unlink()
    said_by("bash", "-ec", release.text, cwd=tmp_path)
    assert released.exists()


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.glob("*_pb2*")}


def test_an_error_is_what_it_shows(address):
    request = MatchRequest()
    for k in range(4):
        points = request.sketch.stroke_set.strokes.add().points
        for x in range(8):
            points.add(x=x, y=k)
    request.map.CopyFrom(request.sketch)
    points[7].x = math.nan
    with grpc.insecure_channel(address) as channel, pytest.raises(grpc.RpcError) as raised:
        list(MatchServiceStub(channel).Match(request))
    (packed,) = (
        value
        for name, value in raised.value.trailing_metadata()
        if name == "grpc-status-details-bin"
    )
    shown = f"code {raised.value.code().name} message {raised.value.details()} details"
    kinds = (error_details_pb2.ErrorInfo, error_details_pb2.BadRequest)
    for detail, kind in zip(status_pb2.Status.FromString(packed).details, kinds, strict=True):
        message = kind()
        assert detail.Unpack(message)
        shown += f" {kind.DESCRIPTOR.full_name} {message}"
    assert ERROR.text.split() == shown.split()
