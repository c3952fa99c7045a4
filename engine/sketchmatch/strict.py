"""How pydantic checks what people write: nothing unknown, nothing that is no number, no changes."""

from __future__ import annotations

from contextlib import suppress

from pydantic import ConfigDict, TypeAdapter

__all__ = ["STRICT"]

STRICT = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

# Its first use reads what each installed distribution says of itself, and raises what a broken one
# makes of that; the second does not.
with suppress(Exception):
    TypeAdapter(int)
