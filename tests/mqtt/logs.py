"""A site run once, its fleet bus read from the log, and what a publisher makes of it."""

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

from bus_sim.cli import main
from bus_sim.sites import find_site
from onboard.contract.messages import Message
from onboard.gateway.publisher import Outgoing, Publisher
from onboard.gateway.settings import GatewaySettings
from onboard.systems.contract import codecs_for
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.decoder import Decoder

SCHEMAS = Path(__file__).parent / "schemas"
#: What comes in is checked on board, so these schemas are in the package.
OWN = Path(__file__).parents[2] / "onboard" / "gateway" / "schemas"
VERSIONS = {"2.1": "2.1.0", "3.0": "3.0.0"}
#: 2026-03-01 06:00:00 UTC
EPOCH_US = 1_772_344_800_000_000


def record(path: Path, *words: str) -> Path:
    """The log of ``bus-sim run`` with these words."""
    assert main(["run", *words, "--trace", str(path)]) == 0
    return path


def messages(site_name: str, log: Path) -> Iterator[tuple[int, Message]]:
    """Every message of the fleet bus with its time, us from the first."""
    decoder = Decoder(codecs_for(find_site(site_name)).fleet)
    first_us: int | None = None
    for line in CandumpReader(log.read_bytes().splitlines(keepends=True)):
        first_us = line.time_us if first_us is None else first_us
        message = decoder.feed(line.frame, line.time_us - first_us)
        if message is not None:
            yield line.time_us - first_us, message


def published(site_name: str, log: Path, **settings: Any) -> list[tuple[int, Outgoing]]:
    """All that a publisher says of a log: its hellos first, then everything with its time."""
    publisher = Publisher(find_site(site_name), GatewaySettings(epoch_us=EPOCH_US, **settings))
    found = [(0, Outgoing(link, one)) for link in publisher.links for one in publisher.hello(link, 0)]
    for time_us, message in messages(site_name, log):
        while (due_us := publisher.next_wake()) <= time_us:
            found += [(due_us, one) for one in publisher.wake(due_us)]
        found += [(time_us, one) for one in publisher.feed(message, time_us)]
    return found


@cache
def validator(version: str, name: str) -> Draft202012Validator:
    """The validator of one message of a version."""
    folder = OWN if name in ("order", "instantActions") else SCHEMAS
    schema = json.loads((folder / VERSIONS[version] / f"{name}.schema").read_text(encoding="utf-8"))
    return Draft202012Validator(schema, format_checker=Draft202012Validator.FORMAT_CHECKER)


def content(outgoing: Outgoing) -> Any:
    """The payload."""
    return json.loads(outgoing.publication.payload)
