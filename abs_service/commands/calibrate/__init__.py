"""Where the sensors of a rig are, how they project and how they err."""

#: One line of help for each command; kept here so that `--help` imports none of them.
COMMANDS = {
    "convert": "calibrations from and to the formats of other programs",
}
