"""What all tables of a file have in common."""

from pydantic import BaseModel, ConfigDict


class Table(BaseModel):
    """What all tables share: they are frozen and know their keys. No logic."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
