"""Everything public of the face: on its page, typed with what is public, and with errors that say what is wrong."""

import inspect
import re
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import abs_service as a
from tests.abs_service.api.scenes import CAMERA, NOISE

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
PROMISED = {name: getattr(a, name) for name in a.__all__ if name != "noise"}
PROMISED |= {f"noise.{name}": getattr(a.noise, name) for name in a.noise.__all__}
#: Classes of the face itself. Of cameras, lenses and settings, the page says which members are promised.
OWN = [one for one in PROMISED.values() if inspect.isclass(one) and one.__module__.startswith("abs_service.api")]
#: Packages of types that a user meets besides those of the face.
ELSEWHERE = ("builtins", "collections", "numpy", "pathlib", "types", "typing")


def functions(owner: type) -> dict[str, Any]:
    """Public methods and properties of a class, as functions."""
    found = {name: one.fget if isinstance(one, property) else one for name, one in vars(owner).items()}
    return {name: one for name, one in found.items() if not name.startswith("_") and inspect.isfunction(one)}


def fields(owner: type) -> set[str]:
    """Public fields of a class: those of a dataclass, and what its docstring lists."""
    listed = re.search(r"^Attributes:\n((?: {4}.*\n?)*)", inspect.getdoc(owner) or "", re.MULTILINE)
    names = re.findall(r"^ {4}(\w[\w, ]*):", listed[1] if listed else "", re.MULTILINE)
    made = getattr(owner, "__dataclass_fields__", {})
    return {one for some in names for one in some.split(", ")} | {name for name in made if not name.startswith("_")}


def classes(annotation: Any) -> Iterator[type]:
    """All classes in an annotation; a protocol stands for what fulfils it."""
    if inspect.isclass(annotation) and not getattr(annotation, "_is_protocol", False):
        yield annotation
    for part in typing.get_args(annotation):
        yield from classes(part)


CALLS = {name: one for name, one in PROMISED.items() if inspect.isfunction(one)} | {"Tracker": a.Tracker.__init__}
CALLS |= {f"{owner.__name__}.{name}": one for owner in OWN for name, one in functions(owner).items()}


def test_there_are_many():
    assert {"load_rig", "Nurbs", "Tracker.track", "Rig.tracker", "Recording.streams"} <= CALLS.keys()
    assert {"theta", "residuals"} <= fields(a.Estimate)
    assert {"path", "truncated"} <= fields(a.Recording)


@pytest.mark.parametrize("name", PROMISED)
def test_a_promised_name_is_on_the_page_and_has_a_docstring(name):
    assert re.search(rf"[`.]{name}\b|\b{name}\(", PAGE)
    assert inspect.getdoc(PROMISED[name])


@pytest.mark.parametrize(
    ("owner", "name"), [(owner, name) for owner in OWN for name in sorted({*functions(owner), *fields(owner)})]
)
def test_a_public_member_is_on_the_page(owner, name):
    assert re.search(rf"`{name}`|\.{name}\b", PAGE)


@pytest.mark.parametrize("name", CALLS)
def test_what_is_called_is_documented_and_typed_with_public_types(name):
    assert inspect.getdoc(CALLS[name])
    signature = inspect.signature(CALLS[name])
    hints = typing.get_type_hints(CALLS[name])
    assert hints.keys() >= signature.parameters.keys() - {"self"}
    assert "return" in hints or name == "Tracker"
    found = {one for hint in hints.values() for one in classes(hint)}
    hidden = {one for one in found if one.__module__.partition(".")[0] not in ELSEWHERE}
    assert hidden <= set(PROMISED.values())


@pytest.mark.parametrize("call", [a.Tracker, a.Tracker.track, a.Rig.tracker], ids=lambda call: call.__qualname__)
def test_arguments_are_on_the_page(call):
    for name in inspect.signature(call).parameters.keys() - {"self"}:
        assert f"`{name}`" in PAGE, name


class Wrong:
    """Value that no argument could have."""

    def __repr__(self) -> str:
        return "<wrong>"


RECORDING = a.open_recording(ROOT / "recordings" / "sample.mcap")
SIZES = {"width": 640, "height": 480, "fx": 528, "fy": 528, "cx": 320, "cy": 240}
#: Every call of the face, with the arguments that it needs.
USED = [
    (a.Tracker, {"depth": CAMERA, "model": a.Rigid(), "color": CAMERA}),
    (a.Tracker(CAMERA, a.Rigid(), noise=NOISE, color=CAMERA).track, {"time_s": 0.0}),
    (a.Tracker(CAMERA, a.Rigid()).replay, {}),
    (RECORDING.rig.tracker, {}),
    (RECORDING.estimates, {}),
    (a.load_rig, {}),
    (a.open_recording, {}),
    (a.Recording, {}),
    (a.Camera, SIZES),
    (a.Lens, {}),
    (a.Fisheye, {}),
    (CAMERA.project, {}),
    (CAMERA.unproject, {}),
    (CAMERA.distance, {}),
]


@pytest.mark.parametrize(
    ("call", "needed", "name"),
    [
        pytest.param(call, needed, name, id=f"{call.__qualname__} {name}")
        for call, needed in USED
        for name in inspect.signature(call).parameters
    ],
)
def test_an_error_names_the_argument_its_value_and_what_is_allowed(call, needed, name):
    with pytest.raises((a.ArgumentError, a.CameraError, a.LensError)) as raised:
        call(**{**needed, name: Wrong()})
    said = str(raised.value)
    assert re.search(rf"\b{name}\b", said)
    assert re.search(r"<wrong>|has shape \(\)|is given", said)  # an array has a shape in place of a value
    assert re.search("must be|at most|it uses|has no estimates", said)


def test_a_stream_that_is_none_is_named_with_those_that_are():
    with pytest.raises(a.ArgumentError, match=r"streams = 'a/b': must be in .*sample\.mcap, which has tof/depth"):
        RECORDING.images("tof/depth", "a/b")


def test_weights_that_are_no_table_are_named():
    with pytest.raises(a.ArgumentError, match="weights = <wrong>: must be a table"):
        a.Nurbs(4, 4, weights=Wrong())  # pyright: ignore[reportArgumentType]
