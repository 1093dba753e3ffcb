"""Parts that several commands share: devices of a rig, its processes, the preview."""
