"""The layout for Foxglove and Lichtblick names topics and fields that the demo rig records and `export` writes."""

import json
from pathlib import Path

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys

LAYOUT = json.loads(Path("examples/viewers/layout.json").read_text())
PANELS = LAYOUT["configById"]

SHOWN = {
    "3D": {keys.scene("sheet"), keys.points(keys.image("tof", "depth")), *map(keys.calibration, ("tof", "color"))},
    "Image": {keys.image("tof", "depth"), keys.image("color", "color"), *map(keys.calibration, ("tof", "color"))},
}
MESSAGES = {
    keys.state("sheet"): DeformationState,
    keys.health("capture"): Health,
    keys.health("track/sheet"): Health,
}


def leaves(node):
    return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])


def test_every_panel_has_a_place():
    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)


def test_panels_in_space_show_topics_of_the_rig():
    topics = {"3D": set(PANELS["3D!scene"]["topics"]), "Image": set()}
    for name in PANELS:
        if name.startswith("Image!"):
            mode = PANELS[name]["imageMode"]
            topics["Image"] |= {mode["imageTopic"], mode["calibrationTopic"]}
    assert topics == {kind: {f"/{topic}" for topic in shown} for kind, shown in SHOWN.items()}
    assert PANELS["3D!scene"]["followTf"] == keys.RIG_FRAME


def test_plots_show_fields_of_messages():
    paths = [path["value"] for panel in PANELS.values() for path in panel.get("paths", ())]
    assert len(paths) == 5
    for path in paths:
        topic, _, field = path.removeprefix("/").partition(".")
        assert field in MESSAGES[topic].DESCRIPTOR.fields_by_name
    assert PANELS["RawMessages!health"]["topicPath"].removeprefix("/") in MESSAGES
