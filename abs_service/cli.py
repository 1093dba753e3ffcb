"""The command line. Each command is a module of `abs_service.commands`, imported only when it is chosen.

Such a module has a docstring (its help; examples after the first paragraph), `add_arguments(parser)` and
`run(arguments) -> int`, which returns the exit code. Or it is a package with commands of its own, named by its
`COMMANDS`: `abs-service calibrate rig` is `abs_service.commands.calibrate.rig`.
"""

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from types import ModuleType
from typing import Any

import abs_service
from abs_service.supervision.children import parent_watchdog
from abs_service.supervision.exit_codes import Exit, lack_of_host
from abs_service.supervision.process_setup import kernel_cache, standard_files

#: One line of help for each command; kept here so that `--help` imports none of them.
COMMANDS = {
    "run": "track live: devices, trackers and recorder, supervised, with a status table",
    "status": "ask a running rig how it is; the exit code says whether it works",
    "replay": "track a recording again, frame by frame",
    "new": "write the rig file for what you have, after some questions",
    "view": "show a running rig in the browser: mesh, points, images, status",
    "check": "validate a configuration and print what it describes",
    "devices": "list attached devices, with a remedy for those that cannot be used",
    "calibrate": "calibrate intrinsics, extrinsics and noise of a rig's sensors",
    "stiffness": "bending stiffness of a strip that hangs from a gripper, from a recording",
    "import": "turn a folder of images, or a file of another program, into a recording",
    "export": "write a recording for viewers, or its estimates as CSV, NPZ, OBJ or PLY",
    "info": "describe recordings: sensors, rates, gaps, losses, tracking, sizes",
    "recover": "recover truncated or damaged recordings",
    "capture": "only the devices: publish their images",
    "track": "only one tracker: subscribe to images, publish the deformation",
    "reinitialize": "make a running tracker detect its object again",
    "reload": "make a running rig read its file again; what is not concerned goes on",
    "trigger": "make a running recorder record, with the seconds before, or wait again",
    "keys": "make the certificates with which hosts and applications prove who they are",
    "completion": "print a script that completes commands and options in bash, zsh or fish",
    "record": "only the recorder: subscribe to everything, write MCAP files",
}

#: Modules of `abs_service.commands` that do not lie there under the name of their command, by its whole name.
MODULES = {
    "import": "images.import_images",
    "new": "new.new",
    **{name: f"running.{name}" for name in ("reinitialize", "reload", "status", "trigger", "view")},
    **{name: f"processes.{name}" for name in ("capture", "record", "track")},
    **{name: f"recordings.{name}" for name in ("export", "info", "recover", "replay", "stiffness")},
}

#: Modules that import what the processes of a command have in common, by its name.
PRELOADED = {"run": "abs_service.commands.processes.preloaded"}

#: Threads of the libraries that compute, read when they are first imported. Arrays are small here, so that more threads
#: cost time, and BLAS its order of summation. One thread in each process is also what shares the cores fairly.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")

#: Time that threads have to end after their command [s].
THREADS_END_S = 1.0

EPILOG = """\
examples:
  abs-service run                        a simulated sheet of paper, nothing to connect or configure
  abs-service new rig.toml               asks what you have, and describes it in a file
  abs-service run rig.toml               your own sensors
  abs-service check rig.toml             what that file describes, without touching a device
  abs-service replay recordings/x.mcap   the same estimates again, from a file

abs-service COMMAND --help describes each command.
"""


def program() -> None:
    """Runs the command line as a process, which ends even if a thread does not, such as a callback that waits."""
    standard_files.secure()
    try:
        standard_files.check_folder()
        standard_files.allow_files()
        kernel_cache.check_threads()
        kernel_cache.ensure()
        _preload(sys.argv[1:])
        code = main()
    except standard_files.StartError as error:
        print(f"abs-service: error: {error}", file=sys.stderr)
        code = Exit.USER
    except KeyboardInterrupt:  # while it imports
        code = Exit.INTERRUPTED
    except Exception as error:
        if lack := lack_of_host(error):
            print(f"abs-service: error: {lack}", file=sys.stderr)
        else:
            sys.excepthook(type(error), error, error.__traceback__)
        code = Exit.FAILED
    deadline_s = time.monotonic() + THREADS_END_S
    others = [one for one in threading.enumerate() if one is not threading.main_thread() and not one.daemon]
    for thread in others:
        thread.join(max(0.0, deadline_s - time.monotonic()))
    if stuck := [thread.name for thread in others if thread.is_alive()] + _stuck_processes():
        print(f"abs-service: left behind, since they do not end: {', '.join(stuck)}", file=sys.stderr, flush=True)
        sys.stdout.flush()
        os._exit(code)
    sys.exit(code)


def _stuck_processes() -> list[str]:
    """Names of child processes that not even SIGKILL has ended, since they wait for a disk or a driver."""
    multiprocessing: Any = sys.modules.get("multiprocessing")  # would wait for them when the interpreter ends
    return [process.name for process in multiprocessing.active_children()] if multiprocessing else []


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code; see `Exit`."""
    _compute_with_one_thread()
    reconfigured = parent_watchdog.start()
    name, commands, given = "", COMMANDS, list(sys.argv[1:] if argv is None else argv)
    module = import_module("abs_service.commands")
    while commands:
        parser = _parser() if not name else _group_parser(name, module, commands)
        if not given:
            parser.print_help(sys.stderr)
            return Exit.USER
        if given[0].startswith("-") and given[0] not in ("-h", "--help", "--version"):
            parser.error(f"{given[0]}: no such option before a command")
        chosen = parser.parse_args(given[:1]).command
        name, given = f"{name} {chosen}".strip(), given[1:]
        with _ended_by_interrupt():
            module = import_module(f"{module.__name__}.{MODULES.get(name, chosen)}")
        commands = getattr(module, "COMMANDS", {})
    from abs_service.commands.parts.log import logs  # noqa: PLC0415 - `logging` takes a third of the time of --help
    from abs_service.supervision.process_setup import process_tuning  # noqa: PLC0415 - likewise `ctypes`

    parser = command_parser(name, module)
    logs.add_arguments(parser)
    line = (*name.split(), *given)
    context = argparse.Namespace(commands=COMMANDS, modules=MODULES, reconfigured=reconfigured, command_line=line)
    arguments = parser.parse_args(given, context)
    try:
        logs.set_up(arguments, name, given)
        process_tuning.keep_freed_memory()  # most commands read images, one after the other
        code = module.run(arguments)
        standard_files.flush()  # here, where an error is noticed, and not at the end of the interpreter
        return code
    except KeyboardInterrupt:
        return Exit.INTERRUPTED
    except BrokenPipeError:
        standard_files.discard()
        return Exit.PIPE_CLOSED
    except Exception as error:
        return logs.end_with(standard_files.blamed(error), arguments)


@contextmanager
def _ended_by_interrupt() -> Iterator[None]:
    """Context in which Ctrl-C is no exception, which native libraries swallow or take for a failed import."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: os._exit(Exit.INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _compute_with_one_thread() -> None:
    for variable in THREADS:
        os.environ.setdefault(variable, "1")


def _preload(given: Sequence[str]) -> None:
    """Starts to import what the processes of a command have in common, while this process imports the command."""
    if set(given[:1]) & PRELOADED.keys() and not {"-h", "--help"} & set(given):
        _compute_with_one_thread()
        signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGHUP,))  # until it is known what it means
        from abs_service.supervision.children import forked  # noqa: PLC0415 - `multiprocessing` is for those that need it

        forked.preload(PRELOADED[given[0]])


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="abs-service",
        usage="abs-service [--help] [--version] COMMAND …",
        description="Publishes, in real time, how the object in view of depth cameras deforms.\n\n" + _listed(COMMANDS),
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"abs-service {abs_service.__version__}")
    parser.add_argument("command", type=partial(_command, COMMANDS), help=argparse.SUPPRESS)
    return parser


def _group_parser(name: str, module: ModuleType, commands: Mapping[str, str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"abs-service {name}",
        usage=f"abs-service {name} [--help] COMMAND …",
        description=f"{(module.__doc__ or '').strip()}\n\n{_listed(commands)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", type=partial(_command, commands), help=argparse.SUPPRESS)
    return parser


def _listed(commands: Mapping[str, str]) -> str:
    width = max(map(len, commands))
    return "commands:\n" + "\n".join(f"  {name:<{width}}  {text}" for name, text in commands.items())


def _command(commands: Mapping[str, str], name: str) -> str:
    if name in commands:
        return name
    import difflib  # noqa: PLC0415 - needed after a typing error only

    close = difflib.get_close_matches(name, commands, n=1)
    guess = f' Did you mean "{close[0]}"?' if close else ""
    raise argparse.ArgumentTypeError(f'there is no command "{name}".{guess} There are: {", ".join(commands)}')


def command_parser(name: str, module: ModuleType) -> argparse.ArgumentParser:
    """The parser of one command, without the options that all commands have."""
    parser = argparse.ArgumentParser(
        prog=f"abs-service {name}",
        description=module.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    return parser
