"""Checks of device addresses that need no device."""

from collections.abc import Iterator, Mapping

from abs_service.config.problems import Problem, allowed_instead
from drivers import opening
from drivers.contract.device import AddressError


def check(uris: Mapping[str, str]) -> Iterator[Problem]:
    """Problems of addresses, by device name, that no device can have. Imports their drivers, and opens none."""
    for name, uri in uris.items():
        try:
            opening.check_address(uri)
        except AddressError as error:
            message, scheme = str(error).removeprefix(f"{uri}: "), uri.partition(":")[0]
            if scheme not in (available := opening.available()):
                message = f"no such driver, {allowed_instead(scheme, available)}"
            yield Problem(("devices", name, "uri"), message, uri)
