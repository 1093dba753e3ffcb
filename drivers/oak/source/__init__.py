"""Source of an OAK's images: depthai pipelines on an attached device, or playback of its recordings."""
