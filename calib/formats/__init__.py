"""Calibrations in the formats of other programs, one module each: text to cameras and back.

A module has `read(text, hints) -> Content`, `write(cameras) -> Written`, or one of them. Content that a format or a
camera cannot represent is listed as lost. A lens that a format cannot express is an error.
"""
