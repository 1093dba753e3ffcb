"""The wire format: the generated code is today's, and whoever reads yesterday's bytes still can."""

import json
from importlib.resources import files as resources
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.json_format import MessageToDict, Parse
from grpc_tools import protoc

from tests.abs_service.wire.golden.freeze import BINARY, GOLDEN, JSON, PROTO, breaks, published, schema

SOURCES = sorted(str(path.relative_to(PROTO)) for path in PROTO.rglob("*.proto"))


def test_generated_code_is_what_the_proto_files_say(tmp_path: Path) -> None:
    includes = [f"-I{PROTO}", f"-I{resources('grpc_tools') / '_proto'}"]
    assert protoc.main(["protoc", *includes, f"--python_out={tmp_path}", f"--pyi_out={tmp_path}", *SOURCES]) == 0
    fresh = {path.relative_to(tmp_path): path.read_bytes() for path in tmp_path.rglob("*_pb2.py*")}
    checked_in = {
        path.relative_to(PROTO): path.read_bytes() for path in PROTO.rglob("*_pb2.py*") if path.suffix != ".pyc"
    }
    stale = sorted(str(path) for path in fresh.keys() | checked_in.keys() if fresh.get(path) != checked_in.get(path))
    assert stale == [], "run `make proto`"


def test_every_message_has_golden_bytes() -> None:
    assert sorted(published()) == sorted(path.stem for path in BINARY.glob("*.bin"))


@pytest.mark.parametrize("path", sorted(BINARY.glob("*.bin")), ids=lambda path: path.stem)
def test_golden_bytes_mean_what_their_json_says(path: Path) -> None:
    message = published()[path.stem].FromString(path.read_bytes())
    expected = json.loads((JSON / f"{path.stem}.json").read_text(encoding="utf-8"))
    assert MessageToDict(message, preserving_proto_field_name=True) == expected


@pytest.mark.parametrize("path", sorted(JSON.glob("*.json")), ids=lambda path: path.stem)
def test_golden_json_writes_the_golden_bytes(path: Path) -> None:
    message = Parse(path.read_text(encoding="utf-8"), published()[path.stem]())
    assert message.SerializeToString(deterministic=True) == (BINARY / f"{path.stem}.bin").read_bytes()


def test_golden_files_set_every_frozen_field() -> None:
    frozen = {message.name: message for file in _frozen().file for message in file.message_type}
    unset = [
        f"{name}.{field.name}"
        for name in published()
        for field in frozen[name].field
        if field.name not in json.loads((JSON / f"{name}.json").read_text(encoding="utf-8"))
    ]
    assert unset == []


def test_the_schema_only_ever_grows() -> None:
    assert breaks(_frozen(), schema()) == []


def test_a_reused_number_is_noticed() -> None:
    old, new = schema(), schema()
    header = next(message for file in new.file for message in file.message_type if message.name == "Header")
    header.field[2].name = "count"
    assert breaks(old, new) == [
        "absmsg.v1.Header 3 was seq: optional uint64, implicit presence, is count: optional uint64, implicit presence"
    ]


def test_a_field_may_go_only_if_its_number_is_reserved() -> None:
    old, new = schema(), schema()
    header = next(message for file in new.file for message in file.message_type if message.name == "Header")
    del header.field[2]
    assert len(breaks(old, new)) == 1
    header.reserved_range.add(start=3, end=4)
    assert breaks(old, new) == []


def _frozen() -> FileDescriptorSet:
    return FileDescriptorSet.FromString((GOLDEN / "descriptors.binpb").read_bytes())
