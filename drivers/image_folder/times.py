"""Times of exposures as other programs write them: in lists, and in the names of images."""

import re

#: Units of a Unix time from 2001 to 2286 [decimal digits below a second], by its digits before the point: ms, µs, ns.
_UNITS = {13: 3, 16: 6, 19: 9}
#: More digits before the point than a time since the start of a recording has in seconds.
_MAX_SECONDS_DIGITS = 10

#: A Unix time in a name: seconds with a fraction, or a whole number of ms, µs or ns, which may have one.
_UNIX = re.compile(r"(?<![\d.])(\d{10}\.\d{3,}|\d{10}_\d{9}|(?:\d{13}|\d{16}|\d{19})(?:\.\d+)?)(?!\d)")
#: A name that is nothing but seconds, as from the start of a recording.
_SECONDS = re.compile(r"\d{1,10}\.\d{3,}")


def nanoseconds(text: str) -> int | None:
    """A time [ns], exact, unlike a float of the current Unix time; None if the text is none.

    With 13, 16 or 19 digits before the point it is in ms, µs or ns, with up to 10 in seconds.
    """
    match = re.fullmatch(r"(\d+)(?:\.(\d*))?", text)
    if match is None:
        return None
    whole, fraction = match[1], match[2] or ""
    unit = 0 if len(whole) <= _MAX_SECONDS_DIGITS else _UNITS.get(len(whole))
    return None if unit is None else int(whole + fraction[: 9 - unit].ljust(9 - unit, "0"))


def in_name(stem: str) -> int | None:
    """The time [ns] in the name of an image without its suffix; None without any.

    Numbers are taken for times only where a count of exposures would not look like them: `1305031102.160407` and
    `1305031102_160407000` (s), `Depth_1612345678901.25` (ms), `1305031102160407` (µs), `1305031102160407123` (ns), and
    `0.033333` as the whole name (s).
    """
    if _SECONDS.fullmatch(stem):
        return nanoseconds(stem)
    found = _UNIX.findall(stem)
    return nanoseconds(found[-1].replace("_", ".")) if found else None
