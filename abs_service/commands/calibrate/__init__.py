"""Calibration commands: print a board, capture views, solve intrinsics and extrinsics, fit noise models, verify."""

#: One line of help for each command, here so that `--help` imports none of them.
COMMANDS = {
    "target": "a board to print, true to scale, and its description",
    "capture": "show a board to the sensors: what they have seen, and what is missing",
    "intrinsics": "cameras one by one, from images of a board",
    "rig": "a whole rig in one solve: cameras, poses, distances",
    "noise": "noise model of a depth sensor, from recordings of static scenes",
    "compare": "two calibrations of the same cameras: where they differ, and by how many pixels",
    "convert": "calibrations from and to the formats of other programs",
    "verify": "whether a stored calibration still holds, and which sensor has moved if not",
}
