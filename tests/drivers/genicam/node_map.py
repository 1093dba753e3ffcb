"""Cameras by their description alone: node maps of the GenICam committee's own GenApi, from XML by the SFNC."""

from collections.abc import Mapping
from typing import Any

import pytest

_HEAD = (
    '<RegisterDescription ModelName="Fake" VendorName="Nobody" StandardNameSpace="None" SchemaMajorVersion="1" '
    'SchemaMinorVersion="1" SchemaSubMinorVersion="0" MajorVersion="1" MinorVersion="0" SubMinorVersion="0" '
    'ProductGuid="1" VersionGuid="1" xmlns="http://www.genicam.org/GenApi/Version_1_1">'
)

#: Features as blaze cameras have them.
BLAZE: dict[str, Any] = {
    "ComponentSelector": ["Intensity", "Range", "Confidence"],
    "PixelFormat": ["Mono16", "Coord3D_ABC32f", "Coord3D_C16"],
    "Scan3dOutputMode": ["CalibratedABC_Grid"],
    "Scan3dDistanceUnit": ["Millimeter", "Inch"],
    "Scan3dCoordinateSystem": ["Cartesian", "Spherical"],
    "Scan3dCoordinateScale": 0.25,
    "Scan3dInvalidDataFlag": True,
    "Scan3dInvalidDataValue": 7.0,
    "Scan3dFocalLength": 510.0,
    "Scan3dPrincipalPointU": 319.0,
    "Scan3dPrincipalPointV": 241.0,
    "ExposureTime": (1000.0, 100.0, 2000.0),
    "ExposureAuto": ["Off", "Continuous"],
    "OperatingMode": ["ShortRange", "LongRange"],
}
#: Features as Helios2 cameras have them.
HELIOS: dict[str, Any] = {
    "PixelFormat": ["Mono8", "Coord3D_ABC16", "Coord3D_ABCY16", "Coord3D_CY16"],
    "Scan3dCoordinateScale": 0.25,
    "CalibFocalLengthX": 520.0,
    "CalibFocalLengthY": 521.0,
    "CalibOpticalCenterX": 322.0,
    "CalibOpticalCenterY": 239.0,
    "CalibLensDistortionValueSelector": [f"Value{number}" for number in range(8)],
    "CalibLensDistortionValue": "(S + 1) * 0.01",
    "Scan3dOperatingMode": ["Distance1250mmSingleFreq", "Distance6000mmSingleFreq"],
    "ExposureTimeSelector": ["Exp62_5Us", "Exp250Us", "Exp1000Us"],
}


def node_map(features: Mapping[str, Any]) -> Any:
    """A node map with these features: choices (the first is set), numbers (also with limits), switches and formulas."""
    genapi = pytest.importorskip("genicam.genapi", reason="make all", exc_type=ImportError)
    made = genapi.NodeMap()
    nodes = "".join(_node(name, value) for name, value in features.items())
    made.load_xml_from_string(f'<?xml version="1.0" encoding="utf-8"?>{_HEAD}{nodes}</RegisterDescription>')
    return made


def _node(name: str, value: Any) -> str:
    match value:
        case bool():
            switch = f"<Value>{int(value)}</Value><OnValue>1</OnValue><OffValue>0</OffValue>"
            return f'<Boolean Name="{name}">{switch}</Boolean>'
        case list():
            entries = "".join(
                f'<EnumEntry Name="{entry}"><Value>{number}</Value></EnumEntry>' for number, entry in enumerate(value)
            )
            return f'<Enumeration Name="{name}">{entries}<Value>0</Value></Enumeration>'
        case str():
            variable = '<pVariable Name="S">CalibLensDistortionValueSelector</pVariable>'
            return f'<SwissKnife Name="{name}">{variable}<Formula>{value}</Formula></SwissKnife>'
        case (number, low, high):
            return f'<Float Name="{name}"><Value>{number}</Value><Min>{low}</Min><Max>{high}</Max></Float>'
    return f'<Float Name="{name}"><Value>{value}</Value></Float>'
