"""Device errors, classified by whether a retry can help."""

from collections.abc import Iterator
from contextlib import contextmanager


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
        command: what installs it where no extra can.
        error: of its import; a library of the system may be missing that it needs.
    """

    def __init__(self, package: str, extra: str = "", *, command: str = "", error: ImportError | None = None) -> None:
        if error is None or isinstance(error, ModuleNotFoundError):
            self.reason = f"{package} is not installed"
            self.remedy = command or f".venv/bin/pip install -e '.[{extra}]'"
        else:
            self.reason = f"{package} cannot be loaded: {error}"
            self.remedy = "install what it lacks (docs/how-to/install.md)"
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
        message = str(error)
        if "permission" in message.lower() or "access" in message.lower():
            message = f"{message}; {access_remedy}"
        elif "busy" in message.lower():
            message = f"another program uses it ({message})"
        raise DeviceError(f"{uri}: {message}") from error
