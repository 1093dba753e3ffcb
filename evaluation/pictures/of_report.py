"""Takes a drawing out of a report, for the documentation.

python -m evaluation.pictures.of_report results/stripe/report.html "Amplitude image" docs/images/stripe.svg
"""

import argparse
import base64
import re
from html import unescape
from pathlib import Path

#: A drawing as a report contains it.
_DRAWING = re.compile(r'src="data:image/svg\+xml;base64,([^"]+)"\s+alt="([^"]*)"')


def drawings(report: str) -> dict[str, bytes]:
    """The drawings of a report (HTML), by their alternative text."""
    return {unescape(alt): base64.b64decode(data) for data, alt in _DRAWING.findall(report)}


def main() -> None:
    """Runs the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path, help="report.html of an experiment")
    parser.add_argument("alt", help="beginning of the drawing's alternative text")
    parser.add_argument("out", type=Path, help="file to write, .svg")
    arguments = parser.parse_args()
    found = drawings(arguments.report.read_text(encoding="utf-8"))
    chosen = [svg for alt, svg in found.items() if alt.startswith(arguments.alt)]
    if len(chosen) != 1:
        raise SystemExit(f"{arguments.alt!r} names {len(chosen)} drawings of {arguments.report}: {', '.join(found)}")
    arguments.out.write_bytes(chosen[0])


if __name__ == "__main__":
    main()
