"""Conversion of each message of a recording for its copy for viewers."""

from collections.abc import Mapping
from dataclasses import replace

from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.frame_info_pb2 import FrameInfo
from mcap.records import Message

from abs_service.bus import keys
from abs_service.pairing.observation import ObservationError
from abs_service.pairing.points import points_s, z_image
from abs_service.wire.estimate_messages import MESH, STATE, TOPOLOGY, State
from abs_service.wire.message_header import POINTS, SCENE
from abs_service.wire.viewer_messages import ViewRate, point_cloud, scene_update
from calib.camera import Camera
from calib.lenses.lens import LensError
from drivers.contract.frame import Geometry, Kind
from drivers.encoding import codec, encoded_image
from drivers.encoding.mcap_file import McapFile
from drivers.encoding.parsing import parse_message
from drivers.replay.contents import Contents


class ViewerCopy:
    """Writes the messages of a recording, changed and completed for viewers.

    Images become `foxglove.RawImage`, depth images 32FC1: metres along the optical axis, NaN without return. Meshes and
    points are added, unless the recording has them. All else stays as it is.

    Args:
        file: the copy.
        cameras: of the recording, by sensor.
        contents: of the recording.
        view_hz: largest rate of the meshes and points [Hz]; 0 for none.
    """

    def __init__(self, file: McapFile, cameras: Mapping[str, Camera], contents: Contents, view_hz: float):
        self.file = file
        self.written = 0
        self._cameras = cameras
        self._recorded = {topic.name for topic in contents.topics.values() if topic.count}
        self._view_hz = view_hz
        self._rates: dict[str, ViewRate] = {}
        self._notes: dict[str, str] = {}
        self._waiting: dict[tuple[str, int, int], bytes] = {}  # images and descriptions, until the other one comes
        self._topologies: dict[tuple[str, int], MeshTopology] = {}
        self._status: dict[tuple[str, int], State.Status] = {}

    @property
    def notes(self) -> tuple[str, ...]:
        """Depth images that stay as they were recorded, and why."""
        return tuple(self._notes.values())

    def add(self, topic: str, schema: str, message: Message) -> None:
        """Takes a message.

        Raises:
            CodecError: malformed or inconsistent message.
            OSError: the copy cannot be written.
        """
        data = message.data
        if schema in encoded_image.SCHEMAS:
            self._add_image(topic, message, encoded_image.decode(schema, data), is_image=True)
        elif schema == codec.INFO_SCHEMA:
            self._add_image(topic.removesuffix("info") + "image", message, data, is_image=False)
        else:
            self._write(topic, schema, data, message)
        if schema == TOPOLOGY:
            topology = parse_message(MeshTopology, data)
            self._topologies[topology.header.boot_id, topology.mesh_version] = topology
        elif schema == STATE:
            state = parse_message(State, data)
            self._status[state.header.boot_id, state.header.seq] = state.status
        elif schema == MESH:
            self._add_scene(parse_message(DeformedMesh, data), message)

    def finish(self) -> None:
        """Writes what had no counterpart, and the end of the file."""
        for (topic, log_time, sequence), data in self._waiting.items():
            schema = codec.INFO_SCHEMA if topic.endswith("info") else codec.IMAGE_SCHEMA
            self.file.write(topic, schema, data, log_time, sequence)
            self.written += 1
        self.file.finish()

    def _add_image(self, topic: str, message: Message, data: bytes, is_image: bool) -> None:
        """Takes an image or its description; `topic` is that of the image."""
        info_topic = keys.info(topic)
        own, other = (topic, info_topic) if is_image else (info_topic, topic)
        partner = self._waiting.pop((other, message.log_time, message.sequence), None)
        if partner is None:
            self._waiting[own, message.log_time, message.sequence] = data
            return
        image, info = (data, partner) if is_image else (partner, data)
        if parse_message(FrameInfo, info).kind == Kind.DEPTH:
            image, info = self._depth(topic, image, info, message)
        self._write(topic, codec.IMAGE_SCHEMA, image, message)
        self._write(info_topic, codec.INFO_SCHEMA, info, message)

    def _depth(self, topic: str, image: bytes, info: bytes, message: Message) -> tuple[bytes, bytes]:
        """Image and description in metres along the optical axis; adds the points."""
        frame = codec.decode(image, info)
        try:
            camera = self._cameras[frame.sensor]
            z = z_image(frame, camera)
        except (KeyError, ObservationError, LensError) as error:
            reason = "no camera is recorded" if isinstance(error, KeyError) else error
            self._notes[topic] = f"{topic} stays as it was recorded, without points: {reason}"
            return image, info
        if self._is_due(keys.points(topic), frame.t_host_ns):
            cloud = point_cloud(frame.sensor, message.log_time, points_s(z, camera))
            self._write(keys.points(topic), POINTS, cloud.SerializeToString(), message)
        converted = replace(frame, data=z, encoding="32FC1", scale=1.0, geometry=Geometry.Z, invalid=None)
        header = parse_message(FrameInfo, info).header
        return codec.encode_image(converted, message.log_time), codec.encode_info(converted, header)

    def _add_scene(self, mesh: DeformedMesh, message: Message) -> None:
        topic, boot_id = f"/{keys.scene(mesh.tracker)}", mesh.header.boot_id
        topology = self._topologies.get((boot_id, mesh.mesh_version))
        status = self._status.pop((boot_id, mesh.header.seq), State.STATUS_UNSPECIFIED)
        if (topology is not None or not mesh.vertices_f32) and self._is_due(topic, mesh.header.t_host_ns):
            scene = scene_update(mesh, topology or MeshTopology(), status)
            self._write(topic, SCENE, scene.SerializeToString(), message)

    def _is_due(self, topic: str, t_host_ns: int) -> bool:
        if topic in self._recorded:
            return False
        return self._rates.setdefault(topic, ViewRate(self._view_hz)).due(t_host_ns)

    def _write(self, topic: str, schema: str, data: bytes, message: Message) -> None:
        self.file.write(topic, schema, data, message.log_time, message.sequence)
        self.written += 1
