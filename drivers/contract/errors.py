"""Device errors, classified by whether a retry can help."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: The Python that runs.
PYTHON = sys.version_info[:2]


def pip_install(arguments: str) -> str:
    """Command that installs packages into the environment that runs: that of a clone, or of a service."""
    environment = Path(sys.prefix)
    return f"{'.venv' if _of_a_clone(environment) else environment}/bin/pip install {arguments}"


def install_extra(name: str) -> str:
    """Command that adds an extra of this project to the environment that runs; for a shell in the clone."""
    editable = "-e " if _of_a_clone(Path(sys.prefix)) else ""
    return pip_install(f"{editable}'.[{name}]'")


def _of_a_clone(environment: Path) -> bool:
    return environment.name == ".venv"


class DeviceError(Exception):
    """A device cannot be opened or stopped working; the message names the remedy. A retry may help."""


class FinalError(DeviceError):
    """A retry cannot help: the address, the settings or the installation must be changed first."""


class AddressError(FinalError):
    """An invalid address."""


class SdkMissingError(FinalError):
    """A driver whose library is not installed, or cannot be loaded.

    Args:
        package: the package that cannot be imported.
        extra: the extra of this project that installs it, "" if there is none.
        options: of `pip install`, where no extra installs it.
        newest_python: the last version, such as (3, 13), that its wheels are for, if there are later ones.
        error: of its import; a library of the system may be missing that it needs.
    """

    def __init__(
        self,
        package: str,
        extra: str = "",
        *,
        options: str = "",
        newest_python: tuple[int, int] | None = None,
        error: ImportError | None = None,
    ) -> None:
        if error is not None and not isinstance(error, ModuleNotFoundError):
            self.reason = f"{package} cannot be loaded: {error}"
            self.remedy = "install what it lacks (docs/how-to/install.md)"
        elif newest_python is not None and newest_python < PYTHON:
            this, newest = (".".join(map(str, version)) for version in (PYTHON, newest_python))
            self.reason = f"{package} is not installed, and has no wheel for Python {this}"
            self.remedy = f"make clean all PYTHON=python{newest}"
        else:
            self.reason = f"{package} is not installed"
            self.remedy = pip_install(f"{options} {package}") if options else install_extra(extra)
        super().__init__(f"{self.reason}:  {self.remedy}")


class ControlError(FinalError):
    """An unknown control, or a value that the control does not allow.

    Args:
        control: name of the control.
        given: the value, as the user would write it; "" if the name is unknown.
        allowed: description of the allowed values.
    """

    def __init__(self, control: str, given: str, allowed: str) -> None:
        self.control, self.given, self.allowed = control, given, allowed
        super().__init__(f"{control} = {given}: {allowed}" if given else f"{control}: {allowed}")


@contextmanager
def translated_sdk_errors(uri: str, access_remedy: str) -> Iterator[None]:
    """Translates exceptions of a library into errors that name the device and the remedy.

    Args:
        uri: of the device.
        access_remedy: what helps against a missing permission.

    Raises:
        DeviceError: any exception.
    """
    try:
        yield
    except DeviceError:
        raise
    except Exception as error:
        message = str(error) or repr(error)
        if "permission" in message.lower() or "access" in message.lower():
            message = f"{message}; {access_remedy}"
        elif "busy" in message.lower():
            message = f"another program uses it ({message})"
        raise DeviceError(f"{uri}: {message}") from error
