"""Messages of a tracker, as small as they can be."""

import numpy as np
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

TRIANGLE = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]], "<f4")


def state(seq, version=1, boot="a", t_host_ns=0, host_clock="", **fields):
    header = Header(seq=seq, boot_id=boot, rig="demo", t_host_ns=t_host_ns, host_clock=host_clock)
    fields = {"status": DeformationState.STATUS_TRACKING, "theta": [0.5], "age_ms": 1.0} | fields
    return DeformationState(header=header, tracker="sheet", mesh_version=version, **fields)


def mesh(seq, version=1, boot="a", vertices=TRIANGLE, covariance=b""):
    header = Header(seq=seq, boot_id=boot, rig="demo")
    data = np.asarray(vertices, "<f4").tobytes()
    return DeformedMesh(
        header=header, tracker="sheet", mesh_version=version, vertices_f32=data, covariance_f32=covariance
    )


def topology(version=1, boot="a", vertices=TRIANGLE):
    faces = np.array([[0, 1, 2]] * (len(vertices) - 2), "<u4")
    header = Header(boot_id=boot, rig="demo")
    return MeshTopology(
        header=header,
        tracker="sheet",
        mesh_version=version,
        rest_vertices_f32=np.asarray(vertices, "<f4").tobytes(),
        faces_u32=faces.tobytes(),
    )
