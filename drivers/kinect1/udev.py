"""Permissions: udev rules that let users open the camera, installed once by the administrator."""

#: USB vendor id, and product ids of the cameras.
VENDOR = 0x045E
CAMERAS = {0x02AE: "Kinect for Xbox 360", 0x02BF: "Kinect for Windows"}

#: Audio devices in the same housing; they have a serial number where the camera has none.
AUDIO = frozenset({0x02AD, 0x02BB, 0x02BE, 0x02C3})

#: The tilt motor; unused by this driver, but the rules cover it, too.
MOTOR = 0x02B0

#: Path of the rules file.
PATH = "/etc/udev/rules.d/60-abs-service.rules"

#: Rules that let local users open the devices.
RULES = "\n".join(
    f'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{VENDOR:04x}", ATTR{{idProduct}}=="{product:04x}", MODE="0660", '
    'GROUP="plugdev", TAG+="uaccess"'
    for product in sorted({*CAMERAS, *AUDIO, MOTOR})
)

#: Remedy for missing permission.
PERMISSION_REMEDY = (
    f"abs-service devices --udev | sudo tee {PATH}, then sudo udevadm control --reload, and plug the camera in again. "
    f"The rules for it are:\n{RULES}"
)

#: Remedy for a kernel driver that does not release the camera.
KERNEL_REMEDY = (
    "sudo modprobe -r gspca_kinect; to keep it away: "
    "echo 'blacklist gspca_kinect' | sudo tee /etc/modprobe.d/abs-service.conf"
)
