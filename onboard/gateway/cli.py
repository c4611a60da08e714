"""``onboard gateway``: publish a whole site to a broker from any bus; it only listens unless it takes orders."""

import argparse
import asyncio
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from onboard.config.arguments import Parser
from onboard.config.keys import tool_keys
from onboard.config.problems import ConfigError
from onboard.config.site import load_site
from onboard.core.site import Machine, Site
from onboard.gateway.gateway import Gateway
from onboard.gateway.options import add_mqtt_arguments, broker_address, gateway_settings, plain_warning, watch_lines
from onboard.gateway.reports import Reports
from onboard.gateway.roles_file import load_roles
from onboard.gateway.settings import GatewayError, GatewaySettings, level
from onboard.io.broker_address import BrokerAddress
from onboard.io.journal import FileJournal, JournalDamagedError
from onboard.io.mqtt import MqttBroker
from onboard.io.open_bus import (
    BusOpenError,
    BusSettings,
    OpenBus,
    add_site_arguments,
    bus_settings,
    open_bus,
    parse_with_bus,
)
from onboard.io.seal_lives import SealLivesError
from onboard.io.sealed_bus import sealed_bus
from onboard.io.signals import ended_by
from onboard.ports.broker import BrokerError
from onboard.ports.bus import Bus
from onboard.seal.keys import Keys
from onboard.systems.contract import codecs_for
from onboard.wire.codec import Codec

EXAMPLES = """\
exit status: 0 stopped by a person; 1 the bus is gone or not there yet; 2 a mistake in the command line or in a file

examples:
  onboard gateway -i socketcan -c can0 --site mysite.toml --mqtt mqtt://127.0.0.1
      listens to a real bus; terminal reports are kept in ./spool until the broker has them
  onboard gateway -i socketcan -c can0 --site mysite.toml --mqtt mqtt://127.0.0.1 --orders 251 --roles roles.toml
      the same, and takes orders (docs/mqtt.md)
  onboard gateway -i socketcand-asyncio -c fleet --bus-kwargs host=127.0.0.1 port=29536 --site mysite.toml \\
          --mqtt mqtts://broker.example --mqtt-ca ca.pem --mqtt-cert gateway.pem --mqtt-key gateway.key --vda5050 3.0
"""
#: What has become of the sessions is looked at so often, s, and told where it has changed.
NEWS_S = 1.0


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard gateway``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard gateway",
        description="Publish a site over MQTT: VDA 5050 for every machine that travels, JSON for the fleet.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_site_arguments(parser)
    parser.add_argument(
        "--spool",
        type=Path,
        default=Path("spool"),
        metavar="DIR",
        help="where terminal reports wait for the broker (default: ./%(default)s)",
    )
    parser.add_argument(
        "--orders",
        type=int,
        metavar="NODE",
        help="take orders too, and speak on the bus under this node-ID, 251 to 255, that nobody else there has",
    )
    parser.add_argument("--roles", type=Path, metavar="FILE", help="with --orders: who may fetch what (docs/mqtt.md)")
    parser.add_argument("--keys", type=Path, metavar="FILE", help="with --orders: its keys, where the site has seals")
    add_mqtt_arguments(parser, required=True)
    return parser


def main(argv: Sequence[str]) -> int:
    """Entry point; returns the exit status."""
    args = parse_with_bus(build_parser(), argv)
    try:
        site = load_site(args.site)
        roles = load_roles(args.roles, site) if args.roles is not None else {}
        settings = gateway_settings(args, node_id=args.orders, roles=roles)
        address = _broker(args)
        bus = bus_settings(args, BusSettings(interface="", channel="", bitrate=site.bitrate))
        keys = None if args.orders is None else tool_keys(args.keys, site, args.orders)
        return asyncio.run(_run(site, settings, address, bus, args.spool, None if keys is None else (keys, args.keys)))
    except (ConfigError, BusOpenError, GatewayError, BrokerError, SealLivesError) as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"onboard gateway: {line}", file=sys.stderr)
        return 1 if isinstance(error, BusOpenError) and error.may_come else 2
    except OSError as error:
        print(f"onboard gateway: --spool {args.spool}: {error.strerror or error}; name another folder", file=sys.stderr)
        return 2


def beside(args: argparse.Namespace, site: Site, machine: Machine) -> Callable[[OpenBus, Codec], Gateway]:
    """The gateway of one controller: call it on the running loop with the fleet bus. Raises as the options do."""
    settings = gateway_settings(args, serials=frozenset({machine.name}))
    broker = MqttBroker(_broker(args))
    client = f"{settings.prefix}-{level(site.name)}"

    def build(bus: OpenBus, codec: Codec) -> Gateway:
        gateway = Gateway(site, codec, broker, settings, wall_us=wall_us, client=client)
        bus.subscribe(gateway.on_frame, gateway.on_frame)
        return gateway

    return build


def _broker(args: argparse.Namespace) -> BrokerAddress:
    """The broker that the options name, with a word to people where everybody on the way could speak for it."""
    address = broker_address(args)
    warning = plain_warning(address)
    if warning:
        print(f"warning: --mqtt {warning}", file=sys.stderr)
    return address


async def _run(
    site: Site,
    settings: GatewaySettings,
    address: BrokerAddress,
    bus: BusSettings,
    spool: Path,
    seals: tuple[Keys, Path] | None,
) -> int:
    """``seals``: what it seals with where the site has seals, and the file of that."""
    broker = MqttBroker(address)
    journal = FileJournal(spool, f"{site.name} gateway")
    try:
        reports = Reports(journal)
        if not journal.condition.is_reliable:
            raise JournalDamagedError(f"{journal.condition.why}; move the file away: what waits in it is lost")
        opened = await open_bus(bus)
        try:
            codec = codecs_for(site).fleet
            client = f"{settings.prefix}-{level(site.name)}"
            spoken: Bus = opened
            if seals is not None:
                spoken = await sealed_bus(opened, site, *seals, codecs_for(site).fleet.decode_part)
            send = spoken.send if settings.node_id is not None else None
            gateway = Gateway(site, codec, broker, settings, reports=reports, wall_us=wall_us, client=client, send=send)
            # What a node of this computer sends on the same interface is heard as well.
            spoken.subscribe(gateway.on_frame, gateway.on_frame)
            print("\n".join(watch_lines(address, site, settings)), flush=True)
            return await _until_ended(gateway, opened)
        finally:
            await opened.close()
    finally:
        await journal.close()


async def _until_ended(gateway: Gateway, bus: OpenBus) -> int:
    """Until a signal ends it, or the bus is gone for good."""
    loop = asyncio.get_running_loop()
    status = 0

    def on_lost(task: "asyncio.Task[str]") -> None:
        nonlocal status
        if not task.cancelled():
            status = 1
            print(f"onboard gateway: the bus is gone: {task.result()}", file=sys.stderr)
            gateway.stop()

    lost = loop.create_task(bus.wait_lost())
    lost.add_done_callback(on_lost)
    news = loop.create_task(_tell_news(gateway))
    try:
        with ended_by(loop, lambda _: gateway.stop()):
            await gateway.run()
    finally:
        lost.cancel()
        news.cancel()
    return status


async def _tell_news(gateway: Gateway) -> None:
    """One line whenever the sessions with the broker have changed, or something was lost."""
    shown = ""
    while True:
        await asyncio.sleep(NEWS_S)
        line = gateway.news()
        if line != shown:
            shown = line
            print(line, flush=True)


def wall_us() -> int:
    """Wall time in us since 1970."""
    return time.time_ns() // 1000
