"""The car park's page: cars in and out, arrivals by chance, segments that a person blocks; and what all runs take."""

import asyncio
import re
from datetime import datetime
from typing import Any

from bus_sim.demand import Law
from bus_sim.faults.operators import STATION
from bus_sim.systems.car_park.by_hand import StreetByHand
from bus_sim.systems.car_park.simulation import Simulation
from bus_sim.web.run_source import Arguments, RunSource
from onboard.contract.codes import Reason
from onboard.contract.messages import Blocked, Clear
from onboard.core.site import Segment
from onboard.ports.bus import Bus
from onboard.systems.car_park.site import car_park
from onboard.ways.site import TrackKind, way_site
from onboard.web.app import CommandError, number
from onboard.wire.codec import fleet_codec


class CarParkSource(RunSource):
    """A car park's run in this process."""

    def __init__(self, simulation: Simulation, zero: datetime) -> None:
        """``zero`` is the local time of loop time 0."""
        acts = {
            "car_in": self._car_in,
            "car_out": self._car_out,
            "arrivals": self._set_arrivals,
            "block": self._block,
            "clear": self._clear,
        }
        if any(one.charging for one in car_park(simulation.site).classes):
            acts["car_in_charging"] = self._car_in_charging
        super().__init__(simulation, zero, acts)
        self._simulation = simulation
        self._hand = StreetByHand(simulation.plant.street, simulation.options.seed)
        self._arrivals: asyncio.Task[None] | None = None
        self._station: Bus | None = None

    def snapshot(self) -> dict[str, Any]:
        """The picture, with mean waiting times in s as the street measures them."""
        summary = self._simulation.plant.street.summary()
        waits = (summary.in_wait_us, summary.out_wait_us)
        means = [sum(times) / len(times) / 1e6 if times else None for times in waits]
        return {**super().snapshot(), "waiting": {"in_s": means[0], "out_s": means[1]}}

    def _car_in(self, _: Arguments) -> str:
        return f"{self._hand.car_in()} comes in"

    def _car_in_charging(self, _: Arguments) -> str:
        return f"{self._hand.car_in(charging=True)} comes in to charge"

    def _car_out(self, _: Arguments) -> str:
        name = self._hand.car_out()
        if name is None:
            raise CommandError("no car is inside that nobody has asked for")
        return f"the owner of {name} comes back"

    def _set_arrivals(self, arguments: Arguments) -> str:
        law = Law(number(arguments, "mean_s", 5, 3600), number(arguments, "sigma_s", 0, 600))
        if self._arrivals is not None:
            self._arrivals.cancel()
        self._arrivals = asyncio.get_running_loop().create_task(self._arrive(law))
        return f"cars come and go every {law.mean_s:g} s +- {law.sigma_s:g} s"

    async def _arrive(self, law: Law) -> None:
        """Cars in, and as many out; who is wanted came first."""
        while True:
            await asyncio.sleep(law.draw_us(self.chance) / 1e6)
            self._hand.car_in()
            await asyncio.sleep(law.draw_us(self.chance) / 1e6)
            self._hand.car_out()

    def _block(self, arguments: Arguments) -> str:
        segment = self._segment(arguments)
        self._say(Blocked(STATION, *segment, Reason.OPERATOR))
        return f"the operator says that nobody can pass {segment}"

    def _clear(self, arguments: Arguments) -> str:
        segment = self._segment(arguments)
        self._say(Clear(STATION, *segment, Reason.OPERATOR))
        return f"the operator says that {segment} can be passed again"

    def _segment(self, arguments: Arguments) -> Segment:
        place = arguments.get("place")
        match = re.fullmatch(r"p\((\d{1,3}),(\d{1,3})\)", place.replace(" ", "")) if isinstance(place, str) else None
        segment = Segment(*map(int, match.groups())) if match is not None else None
        track = way_site(self._simulation.site).tracks.get(segment.track) if segment is not None else None
        if segment is None or track is None or track.kind is TrackKind.LIFT or not 1 <= segment.index <= track.length:
            raise CommandError(f"{place}: no segment of this site; write one such as p(1,3), or click on it")
        return segment

    def _say(self, word: Blocked | Clear) -> None:
        """An operator's station is a node of its own on the fleet bus, above all machines."""
        if self._station is None:
            self._station = self._simulation.tool_bus("operator at the page", STATION)
        for frame in fleet_codec().encode(word):
            self._station.send(frame)
