"""What a test may need that is not there on every machine."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOOLS = ROOT / ".venv-proto" / "bin"
"""Programs of the environment that ``make proto`` makes from ``proto/requirements.txt``."""


def require(condition: object, what: str) -> None:
    """Skip the test where something is missing, and fail it in CI, where nothing may be."""
    if condition:
        return
    if os.environ.get("CI") == "true":
        pytest.fail(f"{what} is missing, and CI skips nothing")
    pytest.skip(f"{what} is missing")


def tool(name: str) -> Path:
    """Return a program of the tool environment, or do without the test."""
    path = TOOLS / name
    require(path.exists(), f"{path.relative_to(ROOT)} (`make proto` makes it)")
    return path
