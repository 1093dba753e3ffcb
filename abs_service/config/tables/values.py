"""Types of single values of a configuration, with messages that name the allowed values."""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote, unquote, urlsplit

from pydantic import AfterValidator, Field, GetCoreSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from abs_service.bus import keys
from abs_service.bus.session import is_endpoint
from abs_service.config import plugins

#: Drivers whose addresses name a file, which starts from the folder of the TOML file like every other path.
FILE_SCHEMES = frozenset({"replay"})
#: Longest name of a file or folder [bytes]: Linux allows no more.
MAX_NAME_LENGTH = 255
#: Longest path [bytes], likewise.
MAX_PATH_LENGTH = 4095
#: Longest time [s], 31 years: clocks count nanoseconds in 64 bits, and threads wait no longer than that.
MAX_DURATION_S = 1_000_000_000
#: Pattern of every address of a device.
URI = re.compile(r"[a-z][a-z0-9_]*:\S+")


def _endpoint(value: str) -> str:
    if not is_endpoint(value):
        raise ValueError('an endpoint is protocol/address:port, for example "tcp/127.0.0.1:7447", without ?…')
    return value


def _uri(value: str, info: ValidationInfo) -> str:
    if not URI.fullmatch(value):
        raise ValueError('a device URI begins with the name of its driver, for example "simulated://sheet?seed=1"')
    parts = urlsplit(value)
    if parts.scheme not in FILE_SCHEMES:
        return value
    path = _base(info) / unquote(parts.netloc + parts.path)
    return f"{parts.scheme}://{quote(str(path))}" + (f"?{parts.query}" if parts.query else "")


def _stream(value: str) -> str:
    if not re.fullmatch(r"[^/]+/[^/]+", value):
        raise ValueError('a stream is sensor/stream, for example "tof/depth"')
    return value


def _from_file(value: Any, base: Path) -> Path:
    if not (isinstance(value, (str, Path)) and str(value)):
        raise ValueError("must be a path; a relative one starts from the folder of this file")
    path = base / value
    if "\0" in str(path) or max(len(os.fsencode(part)) for part in path.parts) > MAX_NAME_LENGTH:
        raise ValueError(f"must be a path whose names have no zero byte and at most {MAX_NAME_LENGTH} bytes")
    if len(os.fsencode(path)) > MAX_PATH_LENGTH:
        raise ValueError(f"must be a path of at most {MAX_PATH_LENGTH} bytes, this file's folder included")
    if str(value).startswith("~"):
        raise ValueError('must be a path; "~" is not replaced by a home folder, which differs from user to user')
    return path


def _base(info: ValidationInfo) -> Path:
    # The folder of the TOML file comes down as pydantic's context.
    return info.context["base"] if info.context else Path()


@dataclass(frozen=True)
class Plugin:
    """Marks a value as a table whose `type` names a module of a package; the value is that module's `Settings`."""

    package: str
    others: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return _plain(lambda value, base: plugins.load(self.package, value, base, *self.others), plugins.table)


@dataclass(frozen=True)
class SettingsOf:
    """Marks a value as a table without `type`; the value is the `Settings` of one module."""

    module: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return _plain(lambda value, base: plugins.settings(self.module, value, base), plugins.plain)


@dataclass(frozen=True)
class FromFile:
    """Marks a path that starts from the folder of the TOML file."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return _plain(_from_file, str)


def _plain(load: Callable[[Any, Path], Any], dump: Callable[[Any], Any]) -> CoreSchema:
    return core_schema.with_info_plain_validator_function(
        lambda value, info: load(value, _base(info)),
        serialization=core_schema.plain_serializer_function_ser_schema(dump),
    )


Seconds = Annotated[float, Field(gt=0, le=MAX_DURATION_S)]
Milliseconds = Annotated[float, Field(gt=0, le=MAX_DURATION_S * 1000)]
OffsetMs = Annotated[float, Field(ge=-MAX_DURATION_S * 1000, le=MAX_DURATION_S * 1000)]
Name = Annotated[str, AfterValidator(keys.check_name)]
Endpoint = Annotated[str, AfterValidator(_endpoint)]
DeviceUri = Annotated[str, AfterValidator(_uri)]
Stream = Annotated[str, AfterValidator(_stream)]
NoiseSettings = Annotated[Any, Plugin("calib.noise", ("calib.noise.images", "abs_service.tracker.measurements"))]
RelativePath = Annotated[Path, FromFile()]
