"""Meshes and points of a copy for viewers are decoded by the schemas in the file, where none of our code is loaded."""

import json
import subprocess
import sys

import numpy as np

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    SIMULATION,
    version,
    vertices,
    write_estimated,
)

READER = """
import json, sys
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader

found = {"meshes": [], "faces": [], "clouds": []}
with open(sys.argv[1], "rb") as stream:
    for schema, channel, message in make_reader(stream).iter_messages(["/sheet/scene", "/tof/depth/points"]):
        pool = DescriptorPool()
        for file in FileDescriptorSet.FromString(schema.data).file:
            pool.Add(file)
        content = GetMessageClass(pool.FindMessageTypeByName(schema.name)).FromString(message.data)
        if schema.name == "foxglove.SceneUpdate":
            for entity in content.entities:
                found["meshes"].append([[p.x, p.y, p.z] for p in entity.triangles[0].points])
                found["faces"].append(list(entity.triangles[0].indices))
        else:
            found["clouds"].append(len(content.data) // content.point_stride)
ours = ("abs_service", "absmsg", "calib", "drivers", "foxglove", "mcap_protobuf")
own = [name for name in sys.modules if name.startswith(ours)]
print(json.dumps(found | {"own": own}))
"""


def test_a_process_without_our_code_decodes_meshes_and_points(tmp_path):
    recording, view = write_estimated(tmp_path / "x.mcap"), tmp_path / "view.mcap"
    assert cli.main(["export", str(recording), "--out", str(view), "--view-hz", "1000"]) == Exit.OK
    command = [sys.executable, "-I", "-c", READER, str(view)]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert found["own"] == []
    for k, (mesh, faces) in enumerate(zip(found["meshes"], found["faces"], strict=True), start=1):
        np.testing.assert_array_equal(mesh, vertices(k))
        np.testing.assert_array_equal(np.reshape(faces, (-1, 3)), FACES[version(k)])
    returns = [
        np.isfinite(frame.si()).sum()
        for k in range(6)
        for frame in SIMULATION.frames(k)
        if (frame.sensor, frame.stream) == ("tof", "depth")
    ]
    assert (len(found["meshes"]), found["clouds"]) == (5, returns)
