"""A car park at the gateway: a transport is a ticket put into a compartment's desk from afar, or its key pressed.

It is the same path as a customer's press (row P52), and the compartment calls for it.
"""

from collections.abc import Callable
from typing import Any

from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.car_park import Promise
from onboard.contract.codes import Operation, OperatorAction
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import OperatorOrder, Reference
from onboard.core.serial import to_bus_ms
from onboard.gateway.bus_orders import BusOrders, NoBusOrders, OrderMessages, RefusedError, refuse_charging, refuse_load
from onboard.gateway.dialect import Json
from onboard.gateway.edge import PhysicalLimits, SystemEdge
from onboard.gateway.order import GatewayOrder, OrderRequest
from onboard.gateway.roles import Role
from onboard.gateway.state import reference_text
from onboard.history.calls import CallOpened, CallRepeated
from onboard.history.history import Fact, History
from onboard.history.loads import LoadTold
from onboard.history.system import SystemFact
from onboard.systems.car_park.fetch_costs import moved_from
from onboard.systems.car_park.history import FetchTimeTold, PromiseTold, car_park_history
from onboard.systems.car_park.site import CarPark
from onboard.trace.view import SiteView
from onboard.ways.site import way_site

#: A ticket is put in again so often until the call for it is heard, us; a compartment passes a second one over.
TICKET_AGAIN_US = 30_000_000
#: A key press is not repeated, for the next car may be another's: heard within this, or refused, us.
KEY_PATIENCE_US = 20_000_000
#: A time that was announced is said again so often until it is noted, us.
ANNOUNCED_AGAIN_US = 5_000_000
_NOT_CALLED_FOR = "the compartment has not called for it: no car in it, it is not ready, or no place is free "


class CarParkOrders(NoBusOrders):
    """A robotized car park; ``view`` is what was heard of it."""

    def __init__(self, site: CarPark, view: SiteView, place: Callable[[int], str | None]) -> None:
        super().__init__(site)
        self._park, self._view, self._place = site, view, place
        #: By the names of orders that announce a time, that time as it is asked for, bus ms; open ones are few.
        self._fetch_ms: dict[str, int] = {}
        self._desks = {machine.name: node for node, machine in site.machines.items() if node in site.compartments}

    def transport(self, body: dict[str, Any]) -> OrderRequest:
        """``to`` a compartment: fetch. ``from`` a compartment: park what stands in it."""
        urgent = body.get("priority", 0) > 0
        refuse_load(body)
        if "fetch_at" in body:
            return self._announced(body)
        if "to" in body:
            node = self._desk(body["to"], "$.to")
            if "car" not in body and "from" not in body:
                raise RefusedError("INCOMPLETE", "name the car, or from where", "$.car")
            refuse_charging(body, "say it when the car is parked")
            car = _car(body["car"]) if "car" in body else self._standing(body["from"])
            return OrderRequest("fetch", node, car, urgent=urgent)
        if "from" not in body:
            raise RefusedError("INCOMPLETE", "name a compartment to hand out at, or one to park from", "$.to")
        charging = body.get("charging", False)
        if not any(one.charging for one in self._park.classes):
            refuse_charging(body, "this site has no place to charge; leave it out")
        return OrderRequest("park", self._desk(body["from"], "$.from"), urgent=urgent, charging=charging)

    def check_role(self, request: OrderRequest, role: Role | None) -> None:
        """Whoever has no ticket answers for a car by a role: without one none is fetched, known number or not."""
        if role is None and request.car is not None:
            raise RefusedError("NOT_ALLOWED", "no role: order under a name that --roles gives one")
        if role is not None and request.fetch_us is None and request.node not in role.desks:
            raise RefusedError("NOT_ALLOWED", "not a desk of this role", "$.to" if request.car else "$.from")
        if role is not None and request.car is not None and request.car.origin not in role.cars:
            raise RefusedError("NOT_ALLOWED", "not a car of this role", "$.car")

    def say(self, order: GatewayOrder, sender: int, wall_us: int) -> OrderMessages:
        """A ticket, or the key."""
        request = order.request
        if request.car is None:
            if order.was_said:
                raise RefusedError("NOT_TAKEN", _NOT_CALLED_FOR + ("to charge at" if request.charging else "for it"))
            key = OperatorAction.CHARGING_KEY if request.charging else OperatorAction.PRESS_KEY
            return OrderMessages((OperatorOrder(sender, request.node, key, Reference(0, 0)),), KEY_PATIENCE_US)
        if request.car not in self._view.history.loads.stations:
            raise RefusedError("UNKNOWN_TICKET", "no such car is in the park", "$.car")
        if request.fetch_us is not None:
            return self._say_announced(order, request.car, wall_us, sender)
        action = OperatorAction.URGENT_TICKET if request.urgent else OperatorAction.INSERT_TICKET
        return OrderMessages((OperatorOrder(sender, request.node, action, request.car),), TICKET_AGAIN_US)

    def task_of(self, order: GatewayOrder, fact: Fact | None) -> Reference | None:
        """The compartment's call for the car, or its next call to park."""
        if not isinstance(fact, CallOpened | CallRepeated):
            return None
        call = fact.call.terms
        if order.request.fetch_us is not None or call.sender != order.request.node or call.depth:
            return None
        if order.request.car is None:
            is_entry = call.operation is Operation.PARK and moved_from(self._park, call) is None
            return call.task if is_entry and order.was_said else None
        is_it = call.operation is Operation.RETRIEVE and call.car == order.request.car
        return call.task if is_it else None

    def is_done(self, order: GatewayOrder, fact: Fact | None) -> bool:
        """The car has left; or it stands in a place, and its parking was the task, which has the car's own name.

        Where the call was not heard, as the gateway was off: the car stands in the bay that it was asked for at.
        """
        if order.request.fetch_us is not None:
            return self._is_noted(order, fact)
        if not isinstance(fact, LoadTold):
            return False
        word, bays = fact.word, {node: one.number for node, one in way_site(self._site).compartments.items()}
        if order.request.car is not None:
            is_there = order.task is None and word.station == bays[order.request.node]
            return word.car == order.request.car and (is_there or word.station == OUTSIDE)
        return (
            order.task is not None
            and word.car == order.task
            and word.station not in (*bays.values(), ANY_STATION, OUTSIDE)
        )

    # --- announced times ---------------------------------------------------------------------------------------

    def _announced(self, body: dict[str, Any]) -> OrderRequest:
        """The compartment at which the car came in is told, and notes it."""
        if "to" in body:
            raise RefusedError("UNSUPPORTED", "a car comes to the desk that its driver goes to; leave it out", "$.to")
        if "car" not in body and "from" not in body:
            raise RefusedError("INCOMPLETE", "name the car, or where it stands", "$.car")
        refuse_charging(body, "say it when the car is parked")
        car = _car(body["car"]) if "car" in body else self._standing(body["from"])
        if car.origin not in self._park.compartments:
            raise RefusedError("UNKNOWN_TICKET", "no such car can be", "$.car")
        return OrderRequest("announce", car.origin, car)

    def _say_announced(self, order: GatewayOrder, car: Reference, wall_us: int, sender: int) -> OrderMessages:
        """Asked until it is noted: somebody else may name another time, so only the same time is an answer."""
        fetch_us, history = order.request.fetch_us, self._view.history
        assert fetch_us is not None
        if fetch_us <= wall_us:
            raise RefusedError("TOO_LATE", "nobody has noted it, and it is past", "$.fetch_at")
        if history.clock.offset_us is None:
            return OrderMessages((), ANNOUNCED_AGAIN_US)
        bus_us = self._view.now_us - history.clock.offset_us
        fetch_ms = self._fetch_ms.setdefault(order.name, to_bus_ms(bus_us + fetch_us - wall_us))
        told = car_park_history(history).fetch_times.get(car)
        if told is not None and told.fetch_ms == fetch_ms and told.fetch_word is not FetchWord.NOTED:
            reason = "UNKNOWN_TICKET" if told.fetch_word is FetchWord.NOT_INSIDE else "TOO_LATE"
            raise RefusedError(reason, f"the compartment answers {told.fetch_word.name}", "$.fetch_at")
        return OrderMessages((FetchTime(sender, car, fetch_ms, FetchWord.ASKED),), ANNOUNCED_AGAIN_US)

    def _is_noted(self, order: GatewayOrder, fact: Fact | None) -> bool:
        if not isinstance(fact, FetchTimeTold) or fact.word.fetch_word is not FetchWord.NOTED:
            return False
        is_it = fact.word.car == order.request.car and fact.word.fetch_ms == self._fetch_ms.get(order.name)
        if is_it:
            del self._fetch_ms[order.name]
        return is_it

    def _desk(self, name: str, path: str) -> int:
        if name not in self._desks:
            raise RefusedError("UNKNOWN_PLACE", f"no compartment; one of {', '.join(self._desks)}", path)
        return self._desks[name]

    def _standing(self, place: str) -> Reference:
        for number, car in self._view.history.loads.standing().items():
            if self._place(number) == place:
                return car
        raise RefusedError("UNKNOWN_TICKET", "no car is known to stand there", "$.from")


def _car(text: str) -> Reference:
    origin, _, number = text.partition(".")
    if int(origin) > 0xFF or int(number) > 0xFFFF:
        raise RefusedError("UNKNOWN_TICKET", "no such car can be", "$.car")
    return Reference(int(origin), int(number))


class CarParkEdge(SystemEdge):
    """A car park: carriers with a speed and a length, cars with limits."""

    def __init__(self, site: CarPark) -> None:
        super().__init__(site)
        self._park = site

    def bus_orders(self, view: SiteView, place: Callable[[int], str | None]) -> BusOrders:
        """Orders from outside become tickets and keys at the compartments' desks."""
        return CarParkOrders(self._park, view, place)

    def told(self, fact: SystemFact, history: History, now_us: int) -> tuple[str, Json] | None:
        """A promise to a customer, or a time that was announced, the first time that it is heard."""
        if isinstance(fact, FetchTimeTold):
            return self._noted(fact, history, now_us)
        if not isinstance(fact, PromiseTold) or not fact.is_first:
            return None
        word = fact.word
        machines = self._park.machines
        body = {"car": reference_text(word.car), "by": machines[word.sender].name}
        return "promise", body | _when(word, history, now_us)

    def of_load(self, load: Reference, history: History, now_us: int) -> Json:
        """When a car will be there for its driver, as the customer was first told."""
        word = car_park_history(history).promises.get(load)
        return {} if word is None else _when(word, history, now_us)

    def _noted(self, fact: FetchTimeTold, history: History, now_us: int) -> tuple[str, Json] | None:
        word = fact.word
        fetch_us = history.clock.log_us(word.fetch_ms, now_us)
        if not fact.is_first or word.fetch_word is not FetchWord.NOTED or fetch_us is None:
            return None
        by = self._park.machines[word.sender].name
        return "announcement", {"car": reference_text(word.car), "by": by, "fetch_at_us": fetch_us}

    def body(self) -> PhysicalLimits:
        """The carrier's axis and length; it takes the heaviest car."""
        axis = self._park.carrier
        return PhysicalLimits(
            axis.speed_mm_s / 1000,
            axis.acceleration_mm_s2 / 1000,
            self._park.carrier_length_mm / 1000,
            float(self._park.cars.max_load_kg),
        )

    def loads(self) -> Json:
        """The factsheet's word of loads: cars, with their limits in m and kg."""
        limits = self._park.cars
        dimensions = {"length": limits.max_length_mm / 1000, "width": 0.0, "height": limits.max_height_mm / 1000}
        most_kg = float(limits.max_load_kg)
        return {"loadSets": [{"setName": "car", "loadType": "car", "loadDimensions": dimensions, "maxWeight": most_kg}]}


def _when(word: Promise, history: History, now_us: int) -> Json:
    ready_us, spread_us = history.clock.log_us(word.ready_ms, now_us), word.spread_ms * 1_000
    if ready_us is None:
        return {}
    ends = {"ready_from_us": ready_us - spread_us, "ready_to_us": ready_us + spread_us}
    return {"ready_us": ready_us, "spread_s": word.spread_ms / 1_000, **ends}


EDGE = CarParkEdge
