"""Devices of every system, alone: asked how they stand they say all that they say at power-up, and no more later."""

from collections import Counter

import pytest

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.devices.link import BusDeviceLink
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.systems.registry import simulated_of
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.mapd_device import TransportKey
from onboard.contract.messages import Message, StateRequest
from onboard.core.frame import Frame
from onboard.wire.decoder import Decoder
from tests.system.test_asks_its_devices import SITES, names, site_named

#: When they are asked, s: between power-up and the first repeat; and until when what they say by themselves counts.
ASKED_S = (0.7, 0.8, 0.9)
END_S = 35.0
Said = list[tuple[float, Message]]


def said(name: str, *asked_s: float) -> Said:
    """What all devices of a site say, where nobody but somebody who asks is there; s."""
    site, loop, heard = site_named(name), VirtualTimeLoop(), Said()

    async def play() -> None:
        run = simulated_of(site).stage(site, RunOptions(seed=1, without=frozenset(names(site))), loop).run
        for node, bus in run.devices.items():
            decoder, codec = Decoder(run.codecs.device), run.codecs.device
            asker = BusDeviceLink(bus.attach(f"asker {node}", node), codec, Decoder(codec), node)

            def hear(frame: Frame, time_us: int, _sender: str, decoder: Decoder = decoder) -> None:
                message = decoder.feed(frame, time_us)
                # What a person types is no state.
                if message is not None and not isinstance(message, StateRequest | TransportKey):
                    heard.append((time_us / 1e6, message))

            bus.tap(hear, errors=ErrorsHeard.NONE)
            for at_s in asked_s:
                loop.call_at(at_s, asker.send, StateRequest(node))
        run.start()
        await run_until(run, lambda: False, round(END_S * 1e6), 1_000_000)
        run.close()

    run_on(loop, play())
    return heard


def between(heard: Said, from_s: float, to_s: float) -> Counter[Message]:
    return Counter(message for at_s, message in heard if from_s <= at_s < to_s)


@pytest.mark.parametrize("name", SITES)
def test_all_that_they_said_at_power_up(name: str) -> None:
    heard = said(name, *ASKED_S)
    first = between(heard, 0.0, 0.5)
    assert first
    assert [between(heard, at_s, at_s + 0.05) for at_s in ASKED_S] == [first] * len(ASKED_S)


@pytest.mark.parametrize("name", SITES)
def test_who_was_asked_thrice_speaks_no_more_often_by_itself(name: str) -> None:
    def by_itself(*asked_s: float) -> Counter[type[Message]]:
        heard = said(name, *asked_s)
        states = {type(message) for message in between(heard, 0.0, 0.5)}
        return Counter(type(one) for one in between(heard, 5.0, END_S).elements() if type(one) in states)

    assert by_itself(*ASKED_S) == by_itself()
