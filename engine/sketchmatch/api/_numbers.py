"""What settings and parameters have in common: frozen, nothing extra, numbers that are numbers."""

from __future__ import annotations

from contextlib import suppress
from types import NoneType
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationInfo, field_validator

__all__ = ["Plain"]

# The first use of pydantic reads what each installed distribution says of itself, and raises what a
# broken one makes of that; the second does not.
with suppress(Exception):
    TypeAdapter(int)


class Plain(BaseModel):
    """Fields that are all known, and of which a number is neither True nor text."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _refuse_what_is_no_number(cls, value: Any, info: ValidationInfo) -> Any:
        annotation = cls.model_fields[info.field_name or ""].annotation
        kinds = set(get_args(annotation) or (annotation,)) - {NoneType}
        if isinstance(value, bool | str) and kinds and kinds <= {int, float}:
            raise ValueError(f"should be a valid {'integer' if kinds == {int} else 'number'}")
        return value
