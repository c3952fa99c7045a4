"""Generate the Python code of the contract: ``python proto/generate.py [--output DIR]``.

Run it with the Python of an environment that has ``proto/requirements.txt``. It replaces
what is generated below ``DIR/sketchmatch_proto/v1``; DIR is ``clients/python`` by default.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

PROTO = Path(__file__).resolve().parent
CLIENT = PROTO.parent / "clients" / "python"
SOURCES = "sketchmatch/v1"
TARGET = "sketchmatch_proto/v1"


def main() -> None:
    """Generate into the folder that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--output", type=Path, default=CLIENT, metavar="DIR")
    generate(parser.parse_args().output)


def generate(output: Path) -> None:
    """Replace the generated code below ``output``."""
    target = output / TARGET
    target.mkdir(parents=True, exist_ok=True)
    for stale in target.glob("*_pb2*"):
        stale.unlink()
    with tempfile.TemporaryDirectory() as scratch:
        compile_protos(Path(scratch))
        for file in sorted(Path(scratch, SOURCES).iterdir()):
            (target / file.name).write_text(in_our_package(file.read_text("utf-8")), "utf-8")


def compile_protos(output: Path) -> None:
    """Run protoc: messages of every file, stubs of those that define a service."""
    names = sorted(f"{SOURCES}/{file.name}" for file in (PROTO / SOURCES).glob("*.proto"))
    services = [name for name in names if name.endswith("_service.proto")]
    protoc(f"--python_out={output}", f"--mypy_out={output}", *names)
    protoc(f"--grpc_python_out={output}", f"--mypy_grpc_out={output}", *services)


def protoc(*arguments: str) -> None:
    """Run the protoc of this environment with the plugins next to this Python."""
    plugins = [
        f"--plugin={plugin}={Path(sys.executable).with_name(plugin)}"
        for plugin in ("protoc-gen-mypy", "protoc-gen-mypy_grpc")
    ]
    command = [sys.executable, "-m", "grpc_tools.protoc", f"--proto_path={PROTO}", *plugins]
    subprocess.run([*command, *arguments], check=True)


def in_our_package(code: str) -> str:
    """Rename imports: the proto package is ``sketchmatch``, a name that the engine has in Python.

    Examples
    --------
    >>> in_our_package("from sketchmatch.v1 import scene_pb2 as sketchmatch_dot_v1_dot_scene__pb2")
    'from sketchmatch_proto.v1 import scene_pb2 as sketchmatch_dot_v1_dot_scene__pb2'
    >>> in_our_package("_.TYPE = sketchmatch.v1.scene_pb2.Scene")
    '_.TYPE = sketchmatch_proto.v1.scene_pb2.Scene'
    """
    code = re.sub(r"\b(from|import) sketchmatch\.v1\b", r"\1 sketchmatch_proto.v1", code)
    return re.sub(r"\bsketchmatch\.v1\.(\w+_pb2)\b", r"sketchmatch_proto.v1.\1", code)


if __name__ == "__main__":
    main()
