"""Freezes the wire format as it is now, so that every later change is measured against it.

    .venv/bin/python -m tests.abs_service.wire.golden.freeze

Each `json/<Message>.json` says in words what `binary/<Message>.bin` holds in bytes; both are for programs in any
language. To add a message: write the JSON with every field set, then run this. It refuses what
breaks an older reader.
"""

import importlib
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from google.protobuf.descriptor import Descriptor, FileDescriptor
from google.protobuf.descriptor_pb2 import DescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.json_format import Parse
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

GOLDEN = Path(__file__).parent
JSON, BINARY = GOLDEN / "json", GOLDEN / "binary"
PROTO = GOLDEN.parents[3] / "proto"


def files() -> list[FileDescriptor]:
    """The descriptors of every .proto file in the checkout."""
    modules = (".".join(path.relative_to(PROTO).with_suffix("").parts) for path in sorted(PROTO.rglob("*_pb2.py")))
    return [importlib.import_module(module).DESCRIPTOR for module in modules]


def published() -> Mapping[str, type[Message]]:
    """The messages that travel on their own, by name: all that begin with a header."""
    descriptors: list[Descriptor] = [message for file in files() for message in file.message_types_by_name.values()]
    return {message.name: GetMessageClass(message) for message in descriptors if "header" in message.fields_by_name}


def schema() -> FileDescriptorSet:
    """All descriptors in one message."""
    descriptors = FileDescriptorSet()
    for file in files():
        file.CopyToProto(descriptors.file.add())
    return descriptors


def breaks(old: FileDescriptorSet, new: FileDescriptorSet) -> list[str]:
    """Fields that a reader of the old schema would misread in the new one, one line each; fields may only be added.

    A field that is gone is fine where its number is reserved, because then nothing else can ever mean it.
    """
    now = dict(_numbers(new))
    reserved = set(_reserved(new))
    return [
        f"{place} was {meaning}, is {now.get(place, 'gone, and its number is not reserved')}"
        for place, meaning in _numbers(old)
        if now.get(place) != meaning and not (place in reserved and place not in now)
    ]


def _numbers(descriptors: FileDescriptorSet) -> Iterator[tuple[str, str]]:
    """Pairs such as ("absmsg.v1.Header 3", "seq: uint64")."""
    for path, message in _messages(descriptors):
        for field in message.field:
            kind = field.type_name or field.Type.Name(field.type).removeprefix("TYPE_").lower()
            label = field.Label.Name(field.label).removeprefix("LABEL_").lower()
            presence = "explicit" if field.proto3_optional else "implicit"
            yield f"{path} {field.number}", f"{field.name}: {label} {kind}, {presence} presence"
        for enum in message.enum_type:
            for value in enum.value:
                yield f"{path}.{enum.name} {value.number}", value.name


def _reserved(descriptors: FileDescriptorSet) -> Iterator[str]:
    for path, message in _messages(descriptors):
        for numbers in message.reserved_range:
            yield from (f"{path} {number}" for number in range(numbers.start, numbers.end))


def _messages(descriptors: FileDescriptorSet) -> Iterator[tuple[str, DescriptorProto]]:
    def walk(path: str, parent: FileDescriptorProto | DescriptorProto) -> Iterator[tuple[str, DescriptorProto]]:
        children = parent.message_type if isinstance(parent, FileDescriptorProto) else parent.nested_type
        for child in children:
            yield f"{path}.{child.name}", child
            yield from walk(f"{path}.{child.name}", child)

    for file in descriptors.file:
        yield from walk(file.package, file)


def main() -> int:
    """Writes the golden files; exit code 1 if the schema broke."""
    frozen = GOLDEN / "descriptors.binpb"
    old = FileDescriptorSet.FromString(frozen.read_bytes()) if frozen.exists() else FileDescriptorSet()
    broken = breaks(old, schema())
    if broken:
        print("The wire format broke; add fields instead:", *broken, sep="\n  ", file=sys.stderr)
        return 1
    frozen.write_bytes(schema().SerializeToString(deterministic=True))
    for name, message in published().items():
        text = (JSON / f"{name}.json").read_text(encoding="utf-8")
        (BINARY / f"{name}.bin").write_bytes(Parse(text, message()).SerializeToString(deterministic=True))
    return 0


if __name__ == "__main__":
    sys.exit(main())
