"""Who may open the camera: on Linux udev decides, by a rule that the administrator installs once."""

#: The vendor's number, and those of the cameras: Xbox 360, and Kinect for Windows.
VENDOR = 0x045E
CAMERAS = {0x02AE: "Kinect for Xbox 360", 0x02BF: "Kinect for Windows"}

#: The audio parts beside the cameras, which know the serial number where the camera does not.
AUDIO = frozenset({0x02AD, 0x02BB, 0x02BE, 0x02C3})

#: The motor of the foot, which this driver leaves alone, but whoever may look may also turn the head.
MOTOR = 0x02B0

#: Where the rules belong.
PATH = "/etc/udev/rules.d/60-abs-service.rules"

#: Lets users at the machine open them.
RULES = "\n".join(
    f'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{VENDOR:04x}", ATTR{{idProduct}}=="{product:04x}", MODE="0660", '
    'GROUP="plugdev", TAG+="uaccess"'
    for product in sorted({*CAMERAS, *AUDIO, MOTOR})
)

#: What to do when the camera must not be opened.
PERMISSION_REMEDY = (
    f"abs-service devices --udev | sudo tee {PATH}, then sudo udevadm control --reload, and plug the camera in again. "
    f"The rules for it are:\n{RULES}"
)

#: What to do when the kernel's own driver does not let go of the camera.
KERNEL_REMEDY = (
    "sudo modprobe -r gspca_kinect; to keep it away: "
    "echo 'blacklist gspca_kinect' | sudo tee /etc/modprobe.d/abs-service.conf"
)
