"""Writes a rig file: asks for the attached camera, or a recording, and the kind of object.

  abs-service new rig.toml                       asks
  abs-service new rig.toml --device kinect1 --object sheet --no-color --behind plane       asks nothing
  abs-service new rig.toml --device oak-tof --uri 'oak://18443010E1A2B3C4?mode=tof' …      one of several cameras
  abs-service new rig.toml --recording x.mcap --object body --color --behind things        to replay a recording with

Every question is an option; what is not given as one is asked if a person is there to answer, and an error if not. The
file has comments, and `abs-service check` accepts it.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from abs_service.bus import keys
from abs_service.commands.new import recorded, rig_text
from abs_service.commands.new.rig_text import BEHIND, DEVICES, OBJECTS, Answers, Device
from abs_service.commands.parts.options import OptionError, positive
from abs_service.config.problems import allowed_instead
from abs_service.supervision.exit_codes import Exit
from calib.files import atomic
from drivers import opening
from drivers.contract.discovery import Found

#: Time to look for cameras [s].
DISCOVERY_S = 2.0
#: The choice beside the devices.
RECORDED = {"recording": "nothing: a recording, such as `abs-service import` makes"}
#: Sides of the simulated sheet [m].
SIMULATED_SIZE = (0.3, 0.2)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service new`."""
    parser.add_argument("file", metavar="RIG.toml", type=Path, help="file to write")
    parser.add_argument("--device", choices=DEVICES, type=_known, help="what is attached")
    parser.add_argument("--uri", help="address of one of several cameras (default: the only one)")
    parser.add_argument(
        "--recording", metavar="FILE", type=Path, help="instead of a device: a recording, such as `import` makes"
    )
    parser.add_argument("--object", choices=OBJECTS, help="what is tracked")
    parser.add_argument(
        "--size", nargs=2, type=positive, metavar=("WIDTH", "HEIGHT"), help="of a sheet of known size, in metres"
    )
    parser.add_argument("--color", action=argparse.BooleanOptionalAction, help="use the colour camera as well")
    parser.add_argument("--behind", choices=BEHIND, help="what is behind the object")
    parser.add_argument("--name", help="of the rig on the wire (default: that of the file)")
    parser.add_argument("--force", action="store_true", help="replace a file that exists")


def _known(device: str) -> str:
    """The name of a device that a file can be written for; argparse tells the message of any other."""
    if device not in DEVICES:
        others = "ifm O3R and GenICam: copy examples/rigs/o3r.toml or genicam.toml; others: `abs-service import` their "
        others += "images, then `new --recording FILE`"
        raise argparse.ArgumentTypeError(f"{device!r}: no such device, {allowed_instead(device, DEVICES)}; {others}")
    return device


def run(arguments: argparse.Namespace) -> int:
    """Asks for missing options, and writes the file."""
    file: Path = arguments.file
    if file.exists() and not arguments.force:
        raise OptionError(f"{file}: exists already; choose another name, or replace it with --force")
    name = keys.check_name(arguments.name or file.name.partition(".")[0])
    if sys.stdin.isatty() and sys.stdout.isatty():
        found = opening.discover(DISCOVERY_S) if arguments.device is None else []
        answers = answered(arguments, name, found, _ask)
    else:
        answers = _answered_by_options(arguments, name)
    try:
        atomic.write(file, rig_text.write(answers, str(file)))
    except OSError as error:
        raise OptionError(f"{file}: cannot be written: {error.strerror}") from None
    if answers.device.note:
        print(answers.device.note)
    print(f"wrote {file}; next:", *rig_text.commands(answers.device, str(file)), sep="\n  ")
    return Exit.OK


#: Asks for the answer to an option: its name, the question, and the choices with a text each (none: a line).
Ask = Callable[[str, str, Mapping[str, str]], str]


def answered(arguments: argparse.Namespace, name: str, found: list[Found], ask: Ask) -> Answers:
    """Description of the rig, from the options and the answers.

    Args:
        arguments: the options; an option that is None becomes a question.
        name: of the rig.
        found: attached cameras, which are named first.
        ask: asks a question.

    Raises:
        OptionError: an answer that is impossible.
        RecordingError: a recording that cannot be used.
    """
    device, uri = _device(arguments, found, ask)
    thing = arguments.object or ask("object", "What is the object?", OBJECTS)
    size = arguments.size and (arguments.size[0], arguments.size[1])
    if thing == "known-sheet":
        size = size or _size(ask("size", "Width and height of the sheet in metres, such as 0.297 0.21?", {}))
        if not all(0 < side < 100 for side in size):
            sides = f"{size[0]:g} {size[1]:g}"
            smaller = f"; did you mean {size[0] / 1000:g} {size[1] / 1000:g}?" if min(size) >= 1 else ""
            raise OptionError(f"--size {sides}: sides are lengths in metres, above 0 and less than 100{smaller}")
    color = arguments.color
    if device.color is None:
        if color:
            raise OptionError(f"--color: {device.text} has no colour camera")
    elif color is None:
        color = ask("color", "Is its colour camera used, too?", {"yes": "print and edges", "no": "distances"}) == "yes"
    behind = arguments.behind or ask("behind", "What is behind the object?", BEHIND)
    uri = uri or ("simulated://strip?seed=1" if (device, thing) == (DEVICES["simulated"], "strip") else device.uri)
    return Answers(name, device, uri, thing, size or SIMULATED_SIZE, bool(color), behind)


def _device(arguments: argparse.Namespace, found: list[Found], ask: Ask) -> tuple[Device, str]:
    """The device, and its address if it is not the only one of its kind."""
    kind, uri = arguments.device, arguments.uri or ""
    if arguments.recording is not None:
        if kind or uri:
            raise OptionError("--recording: the file takes the place of a device; leave out --device and --uri")
        return recorded.device(arguments.recording), ""
    if kind is None:
        attached = {one.info.uri: one.info.model for one in found if device_of(one)}
        kinds = {name: device.text for name, device in DEVICES.items()} | RECORDED
        kind = ask("device", "What is attached?", attached | kinds)
        if kind in RECORDED:
            return recorded.device(Path(ask("recording", "Which file?", {}))), ""
        if kind in attached:
            uri, kind = kind, next(named for one in found if one.info.uri == kind and (named := device_of(one)))
    scheme = DEVICES[kind].uri.partition(":")[0]
    if uri:
        if not uri.startswith(f"{scheme}:"):
            raise OptionError(f"--uri {uri}: the address of a device {kind} begins with {scheme}://")
        opening.check_address(uri)
    return DEVICES[kind], uri


def device_of(found: Found) -> str | None:
    """The kind of an attached device; None if it is none of `DEVICES`."""
    scheme = found.info.uri.partition(":")[0]
    if scheme == "oak" and found.info.serial:
        return "oak-tof" if "tof" in found.info.model.lower() else "oak-stereo"
    if scheme == "orbbec" and found.info.serial:
        return "orbbec-tof" if "femto" in found.info.model.lower() else "orbbec-stereo"
    return scheme if scheme in DEVICES and found.info.serial else None


def _size(text: str) -> tuple[float, float]:
    try:
        width, height = map(float, text.replace(",", " ").split())
    except ValueError:
        raise OptionError(f'"{text}": the size is two numbers in metres, such as 0.297 0.21') from None
    return width, height


def _answered_by_options(arguments: argparse.Namespace, name: str) -> Answers:
    """The description by the options alone.

    Raises:
        OptionError: also if options are missing; names all of them.
    """
    missing: list[str] = []
    described = {
        "device": f"{', '.join(DEVICES)}; or --recording FILE",
        "size": "two lengths in metres",
        "color": "--color or --no-color",
    }

    def note(option: str, question: str, choices: Mapping[str, str]) -> str:
        missing.append(f"--{option}: {described.get(option) or ', '.join(choices)}")
        return {"device": "simulated", "size": "1 1"}.get(option, "")  # any answer, to come to the next question

    answers = answered(arguments, name, [], note)
    if missing:
        raise OptionError("\n  ".join(["options are missing, and nobody is there to be asked:", *missing]))
    return answers


def _ask(option: str, question: str, choices: Mapping[str, str]) -> str:
    """Asks until the answer is a number or a name among the choices; any line if there are none.

    Raises:
        OptionError: the input has ended (Ctrl-D).
    """
    print(question)
    width = max(map(len, choices), default=0)
    for number, (name, text) in enumerate(choices.items(), 1):
        print(f"  {number}  {name:<{width}}  {text}")
    while True:
        try:
            answer = input("> ").strip()
        except EOFError:
            raise OptionError(f"the input ended before --{option} was answered; nothing is written") from None
        if not choices or answer in choices:
            return answer
        if answer.isdecimal() and 1 <= int(answer) <= len(choices):
            return list(choices)[int(answer) - 1]
        print(f"a number from 1 to {len(choices)} or one of {', '.join(choices)}, please")
