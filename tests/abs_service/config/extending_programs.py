"""Programs that use the parts of docs/how-to/extending, and a rig file for one of them."""

#: A thermal camera beside a depth camera; the second tracker does without.
THERMAL = """
version = 1
name = "plate"
devices.cameras.uri = "simulated://sheet?sensors=tof,ir"
synchronisation.reference = "tof/depth"

[sensors.tof]
device = "cameras"
noise = { type = "constant", sigma = 0.002 }

[sensors.thermal]
device = "cameras"
head = "ir"
noise = { type = "thermal", sigma_k = 0.1 }

[trackers.warm]
sensors = ["tof", "thermal"]
model = { type = "translation" }
mesh = { vertices = 300 }

[trackers.cold]
sensors = ["tof"]
model = { type = "translation" }
mesh = { vertices = 300 }

[record]
"""

#: Tracks a patch of a wall that slides along itself by 2 mm a frame; prints the largest error of each tracker [m] and
#: the last residuals.
SLIDING = """
import json, sys
import numpy as np
import abs_service as a

camera = a.Camera(96, 72, fx=120, fy=120, cx=47.5, cy=35.5)
rig, generator = a.load_rig(sys.argv[1]), np.random.default_rng(1)
x, y = np.meshgrid((np.arange(96) - 47.5) / 120, (np.arange(72) - 35.5) / 120)
mask = (abs(x) < 0.15) & (abs(y) < 0.12)
trackers = {name: rig.tracker(name, cameras=dict.fromkeys(rig.sensors, camera)) for name in rig.trackers}
trackers["warm"].warm_up()
found, off = {}, dict.fromkeys(trackers, 0.0)
for k in range(6):
    depth = generator.normal(1, 0.002, x.shape)
    kelvin = 300 + 3 * np.sin((x - 0.002 * k) / 0.02) + 3 * np.sin(y / 0.02) + generator.normal(0, 0.1, x.shape)
    streams = {"warm": {"thermal/ir": kelvin}, "cold": None}
    common = {"depth_m": depth, "time_s": k / 30, "mask": mask}
    for name, tracker in trackers.items():
        found[name] = tracker.track(**common, streams=streams[name])
        off[name] = max(off[name], abs(found[name].theta[0] - 0.002 * k))
print(json.dumps([off, dict(found["warm"].residuals)]))
"""

#: Tracks a disc before a wall with the page's template; prints status, centre [m] and largest radius [m].
DISC = """
import json
import numpy as np
import abs_service as a

camera = a.Camera(160, 120, fx=200, fy=200, cx=79.5, cy=59.5)
u, v = np.meshgrid(np.arange(160), np.arange(120))
x, y = (u - 79.5) / 200 * 0.6, (v - 59.5) / 200 * 0.6
on = np.hypot(x - 0.02, y + 0.01) < 0.1
depth = np.where(on, 0.6, 1.2) + np.random.default_rng(1).normal(0, 0.001, on.shape)
template = {"type": "disc", "radius": 0.1}
tracker = a.Tracker(camera, {"type": "translation"}, noise=a.noise.Constant(0.001), template=template, vertices=200)
found = tracker.track(depth, time_s=0)
center = found.vertices.mean(axis=0)
print(json.dumps([found.status, center.tolist(), float(np.linalg.norm(found.vertices - center, axis=1).max())]))
"""

#: Tracks a plate that rests while distances in the margin of the image are off by 4 mm; prints its error [m] by
#: synthesis.
MARGIN = """
import json
import numpy as np
import abs_service as a

camera = a.Camera(96, 72, fx=120, fy=120, cx=47.5, cy=35.5)
x, y = np.meshgrid((np.arange(96) - 47.5) / 120, (np.arange(72) - 35.5) / 120)
mask = (abs(x) < 0.35) & (abs(y) < 0.26)
off = np.full(mask.shape, 0.004)
off[12:-12, 12:-12] = 0
common = {"model": {"type": "translation"}, "noise": a.noise.Constant(0.002), "vertices": 300}
parts = {"inner": {"type": "inner", "margin_px": 12}, "sparse": {"type": "sparse"}}
trackers = {name: a.Tracker(camera, synthesis=part, **common) for name, part in parts.items()}
generator, error = np.random.default_rng(1), {}
for k in range(6):
    depth = np.where(mask, 1.0, 2.0) + generator.normal(0, 0.002, mask.shape) + (k > 0) * off
    for name, tracker in trackers.items():
        error[name] = abs(tracker.track(depth, time_s=k / 30, mask=mask).theta[2])
print(json.dumps(error))
"""

#: Opens the page's device and reads from it for a while; prints frames, drops, the depth in the middle [m] and states.
READING = """
import json, time
from drivers import opening

class Reader:
    frames, states = [], []
    def on_frame(self, frame): self.frames.append(frame)
    def on_state(self, state, reason): self.states.append(state)
    def on_truth(self, truth): ...
    def on_warning(self, condition, message): ...

device, reader = opening.open_device("plate://", time.monotonic_ns), Reader()
device.start(reader)
deadline = time.monotonic() + 20
while len(reader.frames) < 10 and time.monotonic() < deadline:
    time.sleep(0.01)
device.close()
count = len(reader.frames)
time.sleep(0.1)
depth = float(reader.frames[-1].si()[36, 48])
late = len(reader.frames) - count
print(json.dumps([dict(device.counters), count, late, [f.seq for f in reader.frames[:10]], depth, reader.states]))
"""

#: A kind of measurement whose noise model is derived from one of ours, and a program that asks for the kinds of both.
DERIVED = """
from abs_service.tracker.measurements import grey

class Noise(grey.Noise): ...
class Measurement(grey.Measurement): ...
"""
ASKING = """
import json
from my_parts import derived
from abs_service.tracker.measurements import grey, measurement

print(json.dumps([type(measurement(noise)).__module__ for noise in (grey.Noise(), derived.Noise())]))
"""
