"""What can be wrong with a device, sorted by what helps."""


class DeviceError(Exception):
    """A device cannot be opened or stopped working; the message says what to do about it. Trying again may help."""


class FinalError(DeviceError):
    """Trying again is of no use: the address, the settings or the installation have to be changed first."""


class AddressError(FinalError):
    """An address that no device can have, now or later."""


class SdkMissingError(FinalError):
    """A driver whose library is not installed.

    Args:
        package: what cannot be imported.
        extra: the extra of this project that brings it.
    """

    def __init__(self, package: str, extra: str) -> None:
        self.reason = f"{package} is not installed"
        self.remedy = f"pip install 'abs-service[{extra}]'"
        super().__init__(f"{self.reason}:  {self.remedy}")


class ControlError(FinalError):
    """A control that the device does not have, or a value that the control cannot take.

    Args:
        control: name of the control.
        given: the value, as the user would write it; "" if the name is already wrong.
        allowed: what may stand there instead, in plain words.
    """

    def __init__(self, control: str, given: str, allowed: str) -> None:
        self.control, self.given, self.allowed = control, given, allowed
        super().__init__(f"{control} = {given}: {allowed}" if given else f"{control}: {allowed}")
