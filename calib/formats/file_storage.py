"""Parser of OpenCV's FileStorage files into plain values; OpenCV's own parser crashes on some damaged files."""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np
import yaml
from numpy.typing import NDArray

from calib.files import nested
from calib.formats.content import FormatError

#: Tags of arrays; the second one is that of one axis, or more than two.
_MATRIX, _ARRAY = "opencv-matrix", "opencv-nd-matrix"
_XML_ITEMS = re.compile(r'"[^"]*"|\S+')


class _Loader(yaml.SafeLoader):
    """YAML in which a value may be tagged as a matrix."""


def _construct(loader: _Loader, node: Any) -> dict[Any, Any]:
    return _tagged(loader.construct_mapping(node, deep=True))


for _tag in (_MATRIX, _ARRAY):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_tag}", _construct)


def parse(text: str) -> Any:
    """Tables, lists, numbers and strings of a storage; its matrices as arrays, with a third axis for channels.

    Raises:
        FormatError: neither YAML, XML nor JSON, or a matrix whose data do not fit its rows and columns.
    """
    begin = text.lstrip()
    try:
        if begin.startswith("<"):
            return _plain(_xml(begin))
        if begin.startswith("{"):
            return _plain(nested.json(text))
        header, _, body = begin.partition("\n")
        return _plain(yaml.load(body if header.startswith("%YAML") else begin, _Loader))  # which is a SafeLoader
    except (yaml.YAMLError, ElementTree.ParseError, json.JSONDecodeError, RecursionError) as error:
        raise FormatError(f"not a FileStorage of OpenCV, as YAML, XML or JSON: {error}") from error


def _tagged(table: Mapping[Any, Any]) -> dict[Any, Any]:
    return {**table, "type_id": _MATRIX}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        is_array = value.get("type_id") in (_MATRIX, _ARRAY)
        return _matrix(value) if is_array else {key: _plain(one) for key, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list) else value


def _matrix(table: Mapping[str, Any]) -> NDArray[np.float64]:
    try:
        channels = int(re.match(r"\d*", str(table.get("dt", "d")))[0] or 1)  # pyright: ignore[reportOptionalSubscript]
        sizes = np.ravel(table["sizes"]) if "sizes" in table else (table["rows"], table["cols"])
        shape = (*(int(size) for size in sizes), *((channels,) if channels > 1 else ()))
        return np.array(table["data"], np.float64).reshape(shape)
    except (LookupError, OverflowError, TypeError, ValueError) as error:
        raise FormatError("a matrix whose data do not fit its rows and columns") from error


def _xml(text: str) -> Any:
    if "<!" in text.replace("<!--", ""):  # entities can make a short text a long one
        raise FormatError("XML with declarations, which FileStorage never writes")
    return _element(ElementTree.fromstring(text))


def _element(element: ElementTree.Element) -> Any:
    children: Sequence[ElementTree.Element] = list(element)
    if element.get("type_id") in (_MATRIX, _ARRAY):
        lists = ("data", "sizes")
        return _tagged({child.tag: _items(child) if child.tag in lists else _text(child) for child in children})
    if any(child.tag == "_" for child in children):
        return [_element(child) for child in children]
    if children or element.tag == "opencv_storage":
        return {child.tag: _element(child) for child in children}
    items = _items(element)
    return items[0] if len(items) == 1 else items


def _text(element: ElementTree.Element) -> str:
    return (element.text or "").strip().strip('"')


def _items(element: ElementTree.Element) -> list[Any]:
    """Numbers and strings between two tags."""
    return [_number(item) for item in _XML_ITEMS.findall(element.text or "")]


def _number(item: str) -> Any:
    try:
        return float(item)
    except ValueError:
        return item.strip('"')
