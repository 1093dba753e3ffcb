"""Shared fixtures: repeatable property tests, processes of the service, a real device, large data sets, a browser."""

import faulthandler
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import hypothesis
import pytest

from abs_service import cli
from abs_service.bus.security.mutual_tls import MutualTls
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
from tests.ports import free_endpoint, free_port

# The same examples on every machine and in every run; the first one may have to wait for a kernel to compile.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")


# A shell that runs the tests in the background lets them, and all that they start, ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


#: Time that the interpreter has to end after the last line of the report [s]; among many busy programs it took ten.
EXIT_S = 30.0

CHROMIUM = "/usr/bin/chromium"
CHROMIUM_OPTIONS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
    "--use-angle=swiftshader",
]


def pytest_unconfigure(config: pytest.Config) -> None:
    """Ends the process with status 1, and with the stack of each thread, if a thread left by a test keeps it alive."""
    if config.pluginmanager.has_plugin("terminalreporter"):  # not in a worker
        config.get_terminal_writer().flush()  # the end is sudden: what is in a buffer would be lost
    faulthandler.dump_traceback_later(EXIT_S, exit=True, file=2)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", metavar="URI", help="run the hardware tests on this device, for example oak://")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    # Those that take longest first, lest one worker is busy with them when the others have nothing left.
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
    if config.getoption("--device") is not None:
        return
    without_device = pytest.mark.skip(reason="needs a real device: --device URI")
    for item in items:
        if item.get_closest_marker("hardware") is not None:
            item.add_marker(without_device)


@pytest.fixture(scope="session")
def device_uri(request: pytest.FixtureRequest) -> str:
    """The device that the hardware tests run on."""
    return str(request.config.getoption("--device"))


@pytest.fixture(scope="session")
def data_set() -> Callable[[str], Path]:
    """A recorded data set by its name: too large for the repository, so a test that needs one skips without it."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ABS_SHARED_DATA", beside))

    def data_set(name: str) -> Path:
        if not (folder / name).exists():
            pytest.skip(f"no {name} in {folder}; name the folder of the data sets with ABS_SHARED_DATA")
        return folder / name

    return data_set


@pytest.fixture(autouse=True)
def signal_handlers():
    """Handlers that a command sets, in the test's own process, are those of before when the test has ended."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def endpoint():
    """An address on which nobody listens."""
    return free_endpoint()


@pytest.fixture
def port():
    """A port on which nobody listens."""
    return free_port()


@pytest.fixture
def open_bus(endpoint):
    """Opens buses of the rig "demo"; the first is the router. All are closed after the test."""
    opened = []

    def open_bus():
        opened.append(ZenohBus.open("demo", endpoint, SessionMode.CLIENT if opened else SessionMode.ROUTER))
        return opened[-1]

    yield open_bus
    for bus in reversed(opened):
        bus.close()


@pytest.fixture(scope="session")
def keys(tmp_path_factory):
    """A folder with the certificates of a lab whose rig is called localhost, as `abs-service keys` makes them."""
    folder = tmp_path_factory.mktemp("lab") / "keys"
    assert cli.main(["keys", str(folder), "--host", "localhost"]) == 0
    return folder


@pytest.fixture
def secured(keys, endpoint):
    """Opens buses of the rig "demo" with mutual TLS, by the names of their certificates. All are closed afterwards."""
    opened = []

    def secured(name, mode=SessionMode.CLIENT):
        opened.append(ZenohBus.open("demo", encrypted(endpoint), mode, security=mutual_tls(keys, name)))
        return opened[-1]

    yield secured
    for bus in reversed(opened):
        bus.close()


def mutual_tls(keys, name):
    """Security of a process with the certificate of this name."""
    return MutualTls(keys / "authority.pem", keys / f"{name}.pem", keys / f"{name}.key")


def encrypted(endpoint: str) -> str:
    """The same port of this host with TLS; certificates are for names."""
    return endpoint.replace("tcp/127.0.0.1", "tls/localhost")


@pytest.fixture
def launch():
    """Starts `abs-service ARGUMENTS`, or another program in Python; whatever still runs after the test is killed."""
    started = []

    def launch(*arguments, program=("-m", "abs_service"), **settings):
        process = subprocess.Popen(
            [sys.executable, *program, *map(str, arguments)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            stderr=subprocess.PIPE,
            text=True,
            **settings,
        )
        started.append(process)
        return process

    yield launch
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.communicate()


@pytest.fixture
def browser():
    """Chromium; skipped where it is missing."""
    sync_api = pytest.importorskip("playwright.sync_api")
    with ExitStack() as stack:
        try:
            playwright = stack.enter_context(sync_api.sync_playwright())
        except Exception as error:
            pytest.skip(f"Playwright does not start ({error}); without libatomic.so.1: apt install libatomic1")
        try:
            opened = playwright.chromium.launch(executable_path=CHROMIUM, args=CHROMIUM_OPTIONS)
        except sync_api.Error as error:
            pytest.skip(f"no Chromium: {str(error).splitlines()[0]}")
        yield opened
        opened.close()
