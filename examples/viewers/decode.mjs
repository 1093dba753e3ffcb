// Decodes a copy of a recording with the libraries with which Foxglove and Lichtblick read MCAP, and draws it.
//
//   abs-service export recordings/x.mcap --out copy.mcap
//   npm install @mcap/core @mcap/nodejs @mcap/support           # beside this file
//   node decode.mjs copy.mcap copy.html [SECONDS]                # the page needs no server
//
// Only the descriptors inside the file are used. Draws the last triangles and points of each topic until SECONDS after
// its begin, every fourth point.

import { open, writeFile } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";

const [source, page, seconds = Infinity] = process.argv.slice(2);
const readable = new FileHandleReadable(await open(source));
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
const EVERY = 4; // points are many
const types = new Map();
const counts = {};
const last = {};
for await (const message of reader.readMessages()) {
  if (Number(message.logTime - reader.statistics.messageStartTime) > 1e9 * seconds) break;
  const { topic, schemaId } = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(schemaId);
  if (!types.has(schemaId)) types.set(schemaId, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
  last[topic] = { name: schema.name, value: types.get(schemaId).decode(message.data) };
  counts[`${topic} ${schema.name}`] = (counts[`${topic} ${schema.name}`] ?? 0) + 1;
}
console.table(counts);

const of = (name) => Object.values(last).filter((one) => one.name === name).map((one) => one.value);
const transforms = of("foxglove.FrameTransforms").flatMap((one) => one.transforms);
const poses = Object.fromEntries(transforms.map((one) => [one.child_frame_id, one]));

function inRig(frame, [x, y, z]) {
  const pose = poses[frame];
  if (!pose) return [x, y, z];
  const { x: a, y: b, z: c, w } = pose.rotation;
  const t = [2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)];
  return [
    x + w * t[0] + b * t[2] - c * t[1] + pose.translation.x,
    y + w * t[1] + c * t[0] - a * t[2] + pose.translation.y,
    z + w * t[2] + a * t[1] - b * t[0] + pose.translation.z,
  ];
}

const points = of("foxglove.PointCloud").flatMap((cloud) => {
  const data = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.length);
  const places = ["x", "y", "z"].map((name) => cloud.fields.find((field) => field.name === name).offset);
  const step = EVERY * cloud.point_stride;
  return Array.from({ length: data.byteLength / step }, (_, k) =>
    inRig(cloud.frame_id, places.map((place) => data.getFloat32(k * step + place, true))));
});
const triangles = of("foxglove.SceneUpdate").flatMap((scene) => scene.entities).flatMap((entity) =>
  entity.triangles.flatMap((list) =>
    Array.from({ length: list.indices.length / 3 }, (_, k) => {
      const corners = [...list.indices.slice(3 * k, 3 * k + 3)];
      const color = list.colors.length ? list.colors[corners[0]] : list.color;
      const rgb = [color.r, color.g, color.b].map((part) => Math.round(255 * part));
      const places = corners.map((j) => list.points[j]);
      return { corners: places.map(({ x, y, z }) => inRig(entity.frame_id, [x, y, z])), rgb };
    })));
console.log(`${triangles.length} triangles, ${points.length} points`);

// Seen from beside the cameras: y downwards, z away from them.
const draw = (triangles, points) => {
  const canvas = document.querySelector("canvas").getContext("2d");
  const all = triangles.flatMap((one) => one.corners);
  const middle = [0, 1, 2].map((axis) => all.reduce((sum, one) => sum + one[axis], 0) / all.length);
  const turned = ([x, y, z]) => {
    const [a, b, c] = [x - middle[0], y - middle[1], z - middle[2]];
    return [a * Math.cos(0.6) - c * Math.sin(0.6), b + 0.25 * c, a * Math.sin(0.6) + c * Math.cos(0.6)];
  };
  const at = ([x, y, z]) => [400 + (900 * x) / (1 + z), 300 + (900 * y) / (1 + z)];
  const shapes = [
    ...triangles.map((one) => ({ ...one, corners: one.corners.map(turned) })),
    ...points.map((one) => ({ corners: [turned(one)] })),
  ].filter((one) => one.corners[0][2] > -0.9);
  shapes.sort((one, other) => other.corners[0][2] - one.corners[0][2]);
  for (const { corners, rgb } of shapes) {
    canvas.beginPath();
    if (rgb) corners.map(at).forEach(([u, v]) => canvas.lineTo(u, v));
    else canvas.arc(...at(corners[0]), 1, 0, 7);
    canvas.fillStyle = rgb ? `rgb(${rgb})` : "#8ab";
    canvas.fill();
  }
};
await writeFile(page, `<body style="margin:0;background:#181818"><canvas width="800" height="600"></canvas>
<script>(${draw})(${JSON.stringify(triangles)}, ${JSON.stringify(points)})</script>`);
