"""Base class of all tables."""

from pydantic import BaseModel, ConfigDict


class Table(BaseModel):
    """A frozen table that forbids unknown keys. No logic."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
