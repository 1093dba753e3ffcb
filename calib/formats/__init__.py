"""Calibrations in the formats of other programs, one module each: text to cameras and back.

A module has `read(text, hints) -> Content`, `write(cameras) -> Written`, or one of them. What a format has no place for
is listed, so that nothing is lost in silence. A lens that it cannot express is an error.
"""
