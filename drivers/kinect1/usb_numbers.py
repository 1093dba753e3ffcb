"""USB numbers of the camera, and what helps where the kernel holds it."""

#: USB vendor id, and product ids of the cameras.
VENDOR = 0x045E
CAMERAS = {0x02AE: "Kinect for Xbox 360", 0x02BF: "Kinect for Windows"}

#: Audio devices in the same housing; they have a serial number where the camera has none.
AUDIO = frozenset({0x02AD, 0x02BB, 0x02BE, 0x02C3})

#: Remedy for a kernel driver that does not release the camera.
KERNEL_REMEDY = (
    "sudo modprobe -r gspca_kinect; to keep it away: "
    "echo 'blacklist gspca_kinect' | sudo tee /etc/modprobe.d/abs-service.conf"
)
