"""The options by which a command line names a broker and what is published there."""

import argparse
from pathlib import Path

from onboard.bounded_file import read_bounded
from onboard.core.site import Site
from onboard.gateway.roles import Roles
from onboard.gateway.settings import GatewayError, GatewaySettings, level
from onboard.io.broker_address import BrokerAddress, is_loopback, parse_broker

#: Longest file with a password, a key or certificates, bytes: all authorities of a system have a quarter of it.
_MOST_SECRET = 1_000_000


def add_mqtt_arguments(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Add ``--mqtt`` and what goes with it."""
    group = parser.add_argument_group("MQTT (docs/mqtt.md)")
    group.add_argument(
        "--mqtt",
        required=required,
        metavar="URL",
        help="the broker: mqtt://[USER@]HOST[:PORT], or mqtts:// with TLS; a password is read from --mqtt-password",
    )
    group.add_argument("--mqtt-ca", type=Path, metavar="FILE", help="certificate of the broker's authority, PEM")
    group.add_argument("--mqtt-cert", type=Path, metavar="FILE", help="own certificate, PEM")
    group.add_argument("--mqtt-key", type=Path, metavar="FILE", help="key of the own certificate, PEM")
    group.add_argument("--mqtt-password", type=Path, metavar="FILE", help="file whose first line is the password")
    group.add_argument("--vda5050", default="2.1", metavar="VERSION", help="2.1 or 3.0 (default: %(default)s)")
    group.add_argument("--manufacturer", default="onboard", metavar="NAME", help="in topics (default: %(default)s)")
    group.add_argument("--prefix", default="onboard", metavar="NAME", help="of fleet topics (default: %(default)s)")


def broker_address(args: argparse.Namespace) -> BrokerAddress:
    """The broker that the options name. Raises ``GatewayError``: option, value, remedy."""
    try:
        found = parse_broker(args.mqtt)
    except ValueError as error:
        raise GatewayError(f"--mqtt {error}") from error
    files = {"--mqtt-ca": args.mqtt_ca, "--mqtt-cert": args.mqtt_cert, "--mqtt-key": args.mqtt_key}
    for option, path in files.items():
        if path is not None and not found.tls:
            raise GatewayError(f"{option} {path}: goes with TLS only; write --mqtt mqtts://...")
        if path is not None:
            _check_readable(option, path)
    return BrokerAddress(
        found.host,
        found.port,
        found.tls,
        found.user,
        _password(args.mqtt_password),
        args.mqtt_ca,
        args.mqtt_cert,
        args.mqtt_key,
    )


def plain_warning(address: BrokerAddress) -> str:
    """What a person should know of a broker without TLS that is not on this computer; empty for any other."""
    if address.tls or is_loopback(address.host):
        return ""
    return f"{address}: no TLS: whoever is on the way reads all and may order; write mqtts://{address.host}"


def gateway_settings(
    args: argparse.Namespace,
    serials: frozenset[str] = frozenset(),
    node_id: int | None = None,
    roles: Roles | None = None,
) -> GatewaySettings:
    """What is published. Raises ``GatewayError``."""
    return GatewaySettings(
        version=args.vda5050,
        manufacturer=args.manufacturer,
        prefix=args.prefix,
        serials=serials,
        node_id=node_id,
        roles=roles or {},
    )


def watch_lines(address: BrokerAddress, site: Site, settings: GatewaySettings) -> list[str]:
    """How to watch with mosquitto's own program."""
    words = f"mosquitto_sub -h {address.host} -p {address.port}"
    if address.user is not None:
        words += f" -u {address.user} -P ..."
    if address.tls:
        words += f" --cafile {address.ca or '...'} --cert ... --key ..."
    root = f"{settings.prefix}/{level(site.name)}"
    machines = f"{settings.dialect.topic_root}/{settings.manufacturer}"
    lines = [
        f"publishing {site.name} to {address}, VDA 5050 {settings.version}; watch with:",
        f"  {words} -v -t '{root}/#'",
        f"  {words} -v -t '{machines}/+/state'",
    ]
    if settings.node_id is None:
        return lines
    order = '{"id": "A1", "car": "1.1", "to": "IOC1"}'
    said = words.replace("mosquitto_sub", "mosquitto_pub")
    return [
        *lines,
        f"it takes orders as node {settings.node_id}; for a car park:",
        f"  {said} -q 1 -t {root}/orders/{next(iter(settings.roles), 'NAME')} -m '{order}'",
    ]


def _check_readable(option: str, path: Path) -> None:
    """TLS reads a file until it ends, whatever it is: look at it before."""
    try:
        read_bounded(path, _MOST_SECRET)
    except OSError as error:
        raise GatewayError(f"{option} {path}: cannot be read ({error.strerror}); name an existing PEM file") from error


def _password(path: Path | None) -> str | None:
    if path is None:
        return None
    try:
        return read_bounded(path, _MOST_SECRET).decode().splitlines()[0]
    except (OSError, UnicodeDecodeError, IndexError) as error:
        why = getattr(error, "strerror", None) or error
        raise GatewayError(f"--mqtt-password {path}: {why}; name a file whose first line is the password") from error
