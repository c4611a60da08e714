"""The CAN bus itself: who may start, who wins, how long a frame takes, and what happens when it fails.

Everything is a callback in virtual time. One frame or error frame is on the wire at a time. A start of frame is
resolved one bit time later: whoever has a frame ready by then takes part in arbitration, as a node that samples the
start bit before its own may. Times inside are ticks of 1 / (bit rate) microseconds, so that nothing is ever rounded
twice; what others see is rounded up to a whole microsecond.
"""

import heapq
import itertools
from collections.abc import Callable, Sequence
from enum import Enum
from operator import itemgetter
from typing import Final

from bus_sim.can import failures
from bus_sim.can.arbitration import arbitration_key, first_difference
from bus_sim.can.bitstream import INTERMISSION_BITS, SUSPEND_BITS, TAIL_BITS, frame_length_bits
from bus_sim.can.delivery import FrameDelivery
from bus_sim.can.error_counters import ErrorCounters
from bus_sim.can.error_frames import BusError, ErrorsHeard, error_frame, restarted_frame
from bus_sim.can.failures import Failure
from bus_sim.can.faults import FaultInjector, FaultKind, InjectedFault
from bus_sim.can.node import AcceptanceFilter, NodeOptions, SimulatedBus
from bus_sim.can.recovery import TICKS_PER_BIT, BusOffRecovery
from bus_sim.can.repetition import Repetition
from bus_sim.can.statistics import BusStatistics, LoadMeter
from bus_sim.virtual_time import Clock
from onboard.core.frame import Frame
from onboard.ports.bus import ErrorState

#: Called with every frame once, in wire order, the time of its end in microseconds, and the sender's name ("" for
#: error frames).
Tap = Callable[[Frame, int, str], None]

#: A frame in a mailbox: arbitration field, sequence, node, frame.
_Offer = tuple[int, int, SimulatedBus, Frame]

_BIT_RATES: Final = (1_000, 1_000_000)
#: The default of a fleet bus, bit/s.
DEFAULT_BIT_RATE: Final = 500_000


class _Phase(Enum):
    IDLE = 0
    STARTING = 1
    BUSY = 2


class Medium:
    """One CAN bus. ``bit_rate``: 1,000 to 1,000,000 bit/s, ``ValueError`` outside. ``faults`` act in the order given.

    A lone node's frame is not acknowledged and is repeated for ever, as on a real bus: 3,200 times a second at 500
    kbit/s. Where no tap wants to hear of each of them, the bus sets no timers meanwhile, and somebody who comes or asks
    finds it as far as it would be by then.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        bit_rate: int = DEFAULT_BIT_RATE,
        name: str = "can0",
        faults: Sequence[InjectedFault] = (),
    ) -> None:
        if not _BIT_RATES[0] <= bit_rate <= _BIT_RATES[1]:
            raise ValueError(f"bit rate {bit_rate}: classic CAN runs at {_BIT_RATES[0]} to {_BIT_RATES[1]} bit/s")
        self.clock = clock
        self.bit_rate = bit_rate
        self.name = name
        #: The faults at work, with what each has done so far.
        self.injectors = [FaultInjector(fault) for fault in faults]
        self.delivery = FrameDelivery(clock, self.injectors)
        self.recovery = BusOffRecovery(self)
        self._corrupters = tuple(i for i in self.injectors if i.fault.kind is FaultKind.CORRUPTION)
        self._meter = LoadMeter(bit_rate, clock.now_us())
        self._taps: list[Tap] = []
        self._error_taps: dict[ErrorsHeard, list[Tap]] = {heard: [] for heard in ErrorsHeard}
        #: Called by the nodes with every frame that they take for sending.
        self.queue_taps: list[Tap] = []
        self._nodes: list[SimulatedBus] = []
        self._joining: list[SimulatedBus] = []
        self._offers: list[_Offer] = []
        self._sequence = itertools.count()
        self._suspended: list[SimulatedBus] = []
        self._ailing: list[SimulatedBus] = []
        self._phase = _Phase.IDLE
        self._idle_ticks = clock.now_us() * bit_rate
        self._start_ticks = 0
        self._event_us = -1
        for begins_us in {one.fault.from_us for one in self._corrupters if one.fault.from_us > clock.now_us()}:
            # What is repeated to nobody until then may be struck from then on.
            clock.at_us(begins_us, lambda _now_us: self._catch_up())
        self._wire: list[_Offer] = []
        self._wire_bits = 0
        self._failure: Failure | None = None
        self._deaf: list[SimulatedBus] = []
        #: What a lone node says to nobody, since the start of frame that is set.
        self._repetition: Repetition | None = None

    # --- for people and nodes ----------------------------------------------------------------------------------

    def attach(
        self,
        name: str,
        node_id: int | None = None,
        *,
        filters: Sequence[AcceptanceFilter] = (),
        options: NodeOptions | None = None,
    ) -> SimulatedBus:
        """A new node; it hears frames that start from now on. A gateway to another process attaches like any node.

        Raises ``ValueError`` where a node of that name is on the bus.
        """
        if any(node.name == name for node in self._nodes):
            raise ValueError(f"bus {self.name}: a node named {name!r} is attached already")
        self._catch_up()
        node = SimulatedBus(self, name, node_id, filters, options or NodeOptions())
        self._nodes.append(node)
        if self._phase is _Phase.BUSY:
            self._joining.append(node)
        self._members_changed()
        return node

    def add_fault(self, fault: InjectedFault) -> None:
        """One more fault, while the bus is at work. Raises ``ValueError`` for a corruption, which is set beforehand."""
        if fault.kind is FaultKind.CORRUPTION:
            raise ValueError(f"fault {fault}: a corruption is set before the bus is at work")
        injector = FaultInjector(fault)
        self.injectors.append(injector)
        self.delivery.add(injector)

    def tap(self, callback: Tap, *, errors: ErrorsHeard = ErrorsHeard.COUNTED) -> None:
        """See every frame once, in wire order, without being on the bus: no ACK, no error flags."""
        self._catch_up()
        self._taps.append(callback)
        self._error_taps[errors].append(callback)

    def tap_queues(self, callback: Tap) -> None:
        """See every frame as a node takes it for sending, with the time and the node's name (response times)."""
        self.queue_taps.append(callback)

    def statistics(self) -> BusStatistics:
        """What the bus carried up to now."""
        self._catch_up()
        return self._meter.snapshot(self.clock.now_us())

    def restart_statistics(self) -> None:
        """Count frames and load from this moment on, as before an hour that is to be measured."""
        self._catch_up()
        self._meter = LoadMeter(self.bit_rate, self.clock.now_us())

    @property
    def is_silent(self) -> bool:
        """Whether no frame is on the wire."""
        self._catch_up()
        return self._phase is not _Phase.BUSY

    def load(self, node: SimulatedBus, frame: Frame) -> None:
        """A node puts a frame into one of its mailboxes."""
        if self._repetition is not None:
            self._catch_up()
        heapq.heappush(self._offers, (arbitration_key(frame), next(self._sequence), node, frame))
        if self._phase is _Phase.IDLE or self._suspended:
            self._plan()

    def detach(self, node: SimulatedBus, *, in_good_order: bool) -> None:
        """A node leaves; see ``SimulatedBus.close`` and ``power_off``."""
        self._catch_up()
        self._nodes.remove(node)
        for members in (self._joining, self._suspended, self._ailing):
            if node in members:
                members.remove(node)
        self._withdraw(node)
        self.recovery.forget(node)
        self.delivery.silence(node)
        self._members_changed()
        if not in_good_order and any(offer[2] is node for offer in self._wire):
            self._break_off(node)

    def come_back(self, node: SimulatedBus) -> None:
        """A node has recovered from bus-off."""
        node.counters.reset()
        self._members_changed()
        held, node.held = node.held, []
        for frame in held:
            self.load(node, frame)
        self._announce(restarted_frame(), self.clock.now_us())

    # --- start of frame and arbitration ------------------------------------------------------------------------

    def _plan(self) -> None:
        """Set the moment at which the next start of frame is resolved."""
        if self._phase is _Phase.BUSY:
            return
        if not self._offers:
            self._phase = _Phase.IDLE
            return
        start = max(self._idle_ticks, self.clock.now_us() * self.bit_rate)
        if self._suspended:
            start = max(start, min(offer[2].ready_ticks for offer in self._offers))
        if self._phase is _Phase.STARTING and self._start_ticks <= start:
            return
        self._phase = _Phase.STARTING
        self._start_ticks = start
        self._event_us = -(-(start + TICKS_PER_BIT) // self.bit_rate)
        self.clock.at_us(self._event_us, self._resolve)

    def _resolve(self, when_us: int) -> None:
        """The start bit is over: arbitrate among what is on offer."""
        if when_us != self._event_us or self._phase is not _Phase.STARTING:
            return
        if self._suspended and self._is_to_nobody():
            self._repetition = Repetition.of(self._offers[0][3], self._start_ticks)
            return
        waiting = self._step_aside() if self._suspended else []
        offers = self._offers
        wire = [heapq.heappop(offers)] if offers else []
        if wire and offers and offers[0][0] == wire[0][0]:
            self._find_ties(wire)
        for offer in waiting:
            heapq.heappush(offers, offer)
        if wire:
            self._begin(wire)
        else:
            self._phase = _Phase.IDLE
            self._plan()

    def _step_aside(self) -> list[_Offer]:
        """Take out the offers of suspended transmitters, which may not start yet."""
        limit = self._start_ticks + TICKS_PER_BIT
        self._suspended = [node for node in self._suspended if node.ready_ticks >= limit]
        waiting = [offer for offer in self._offers if offer[2] in self._suspended]
        if waiting:
            self._offers = [offer for offer in self._offers if offer[2] not in self._suspended]
            heapq.heapify(self._offers)
        return waiting

    def _find_ties(self, wire: list[_Offer]) -> None:
        """Add the other nodes' offers with the winner's arbitration field; two of one node are no tie."""
        same_node: list[_Offer] = []
        while self._offers and self._offers[0][0] == wire[0][0]:
            offer = heapq.heappop(self._offers)
            tied = all(offer[2] is not other[2] for other in wire)
            (wire if tied else same_node).append(offer)
        for offer in same_node:
            heapq.heappush(self._offers, offer)

    # --- a lone node -------------------------------------------------------------------------------------------

    def _is_to_nobody(self) -> bool:
        """Whether all that happens from this start of frame on is one node's attempts, and nobody looks at them."""
        if len(self._nodes) > 1 or self._error_taps[ErrorsHeard.EVERY] or not self._offers:
            return False
        if any(one.is_at_work(self._start_ticks // self.bit_rate) for one in self._corrupters):
            return False
        node = self._offers[0][2]
        is_free = node.ready_ticks < self._start_ticks + TICKS_PER_BIT
        return is_free and node.counters.state is ErrorState.ERROR_PASSIVE and not node.options.receive_errors

    def _catch_up(self) -> None:
        """Somebody looks: book the attempts that are over, and go on from the one that is under way."""
        repetition, self._repetition = self._repetition, None
        if repetition is None:
            return
        now_us, node = self.clock.now_us(), self._offers[0][2]
        attempts = repetition.failed_before(now_us, self.bit_rate)
        if attempts:
            repetition.book(self._meter, attempts)
            self._start_ticks = node.ready_ticks = repetition.start_ticks + attempts * repetition.period_ticks
            self._idle_ticks = self._start_ticks - SUSPEND_BITS * TICKS_PER_BIT
            self.recovery.bus_idle_from(self._idle_ticks)
            self._event_us = -(-(self._start_ticks + TICKS_PER_BIT) // self.bit_rate)
        if attempts and self._event_us >= now_us:
            self.clock.at_us(self._event_us, self._resolve)
            return
        # As it began: who comes or goes now does so while it is on its way.
        self._phase = _Phase.BUSY
        self._suspended.clear()
        self._wire = [heapq.heappop(self._offers)]
        self._wire_bits = frame_length_bits(self._wire[0][3])
        self._failure = failures.acknowledgement_missing(self._wire_bits)
        self._set_end(self._failure.detected_bits)

    # --- a frame on the wire -----------------------------------------------------------------------------------

    def _begin(self, wire: list[_Offer]) -> None:
        """Put the winner on the wire and find out how it will end."""
        self._phase = _Phase.BUSY
        self._wire = wire
        self.recovery.frame_begins(self._start_ticks)
        failure = self._collide() if len(wire) > 1 else None
        self._wire_bits = frame_length_bits(self._wire[0][3])
        if failure is None and self._corrupters:
            failure = self._corrupt()
        if failure is None and not self._is_acknowledged():
            failure = failures.acknowledgement_missing(self._wire_bits)
        self._failure = failure
        if failure is not None:
            self._set_end(failure.detected_bits)
        else:
            self._idle_ticks = self._start_ticks + self._wire_bits * TICKS_PER_BIT
            self._set_end(self._wire_bits - INTERMISSION_BITS)

    def _set_end(self, bits: int) -> None:
        end_ticks = self._start_ticks + bits * TICKS_PER_BIT
        self._event_us = -(-end_ticks // self.bit_rate)
        self.clock.at_us(self._event_us, self._end)

    def _is_acknowledged(self) -> bool:
        if len(self._wire) == 1:
            return len(self.delivery.listeners) > self._wire[0][2].is_open
        return len(self.delivery.listeners) > sum(offer[2].is_open for offer in self._wire)

    def _collide(self) -> Failure | None:
        """Several nodes send one arbitration field: fine while the frames are equal, else a bit error for some.

        An error-active loser destroys the frame; error-passive ones only drop out, and the others never notice.
        """
        while (collision := first_difference([offer[3] for offer in self._wire])) is not None:
            losers = [self._wire[index] for index in collision.recessive]
            if any(offer[2].counters.state is ErrorState.ERROR_ACTIVE for offer in losers):
                return failures.bit_error(losers[0][3], collision.position)
            self._wire = [offer for offer in self._wire if offer not in losers]
            frame_over = self._start_ticks + frame_length_bits(self._wire[0][3]) * TICKS_PER_BIT
            for offer in losers:
                offer[2].counters.transmission_failed()
                heapq.heappush(self._offers, offer)
                self._confine(offer[2], frame_over)
        return None

    def _corrupt(self) -> Failure | None:
        """Whether a corruption fault strikes this frame, and how the nodes find out."""
        frame, start_us = self._wire[0][3], self._start_ticks // self.bit_rate
        for injector in self._corrupters:
            if not injector.concerns(frame, start_us):
                continue
            if injector.fault.receivers:
                failure = self._corrupt_for_some(injector)
                if failure is not None:
                    return failure
            elif injector.strikes():
                return failures.bit_error(frame, injector.pick_bit(self._wire_bits - TAIL_BITS - INTERMISSION_BITS))
        return None

    def _corrupt_for_some(self, injector: FaultInjector) -> Failure | None:
        """One error-active receiver is enough to destroy the frame; error-passive ones can only miss it."""
        transmitters = [offer[2] for offer in self._wire]
        struck = [
            node
            for node in self.delivery.listeners
            if node not in transmitters and injector.chooses(node.name, node.node_id) and injector.strikes()
        ]
        if any(node.counters.state is ErrorState.ERROR_ACTIVE for node in struck):
            return failures.wrong_crc(self._wire_bits, tuple(struck))
        self._deaf += struck
        return None

    def _break_off(self, node: SimulatedBus) -> None:
        """A transmitter vanished; unless another sends the same bits, the frame is broken."""
        others = [offer for offer in self._wire if offer[2] is not node]
        if others:
            self._wire = others
            return
        gone_bits = (self.clock.now_us() * self.bit_rate - self._start_ticks) // TICKS_PER_BIT
        failure = failures.broken_off(self._wire_bits, gone_bits)
        if failure and (self._failure is None or failure.detected_bits < self._failure.detected_bits):
            self._failure = failure
            self._wire = []
            self._set_end(failure.detected_bits)

    # --- end of frame ------------------------------------------------------------------------------------------

    def _end(self, when_us: int) -> None:
        if when_us != self._event_us or self._phase is not _Phase.BUSY:
            return
        failure, self._failure = self._failure, None
        if failure is None and not self._is_acknowledged():
            failure = failures.acknowledgement_missing(self._wire_bits)
        wire, self._wire = self._wire, []
        deaf, self._deaf = self._deaf, []
        self._phase = _Phase.IDLE
        if failure is None:
            self._succeed(wire, deaf, when_us)
        else:
            self._fail(wire, failure, when_us)
        if self._joining:
            self._joining.clear()
            self._members_changed()
        if self._phase is _Phase.IDLE:
            self._plan()

    def _succeed(self, wire: list[_Offer], deaf: list[SimulatedBus], when_us: int) -> None:
        self._meter.frames += 1
        self._meter.occupy(when_us, self._wire_bits)
        self.recovery.bus_idle_from(self._idle_ticks)
        frame = wire[0][3]
        senders = [offer[2] for offer in wire]
        for node in senders:
            if node.counters.tec or node.counters.rec:
                node.counters.transmission_succeeded()
                self._confine(node, self._idle_ticks)
        if self._ailing or deaf:
            self._heal(senders, deaf)
        for callback in self._taps:
            callback(frame, when_us, senders[0].name)
        for node in senders:
            node.transmitted(frame, when_us)
        self.delivery.deliver(frame, wire[0][0], senders + deaf if deaf else senders, when_us)

    def _heal(self, senders: list[SimulatedBus], deaf: list[SimulatedBus]) -> None:
        """Book a reception for those whose REC is not 0."""
        for node in self._ailing:
            if node not in senders and node not in deaf and node.counters.state is not ErrorState.BUS_OFF:
                node.counters.reception_succeeded()
        for node in deaf:
            node.counters.reception_failed(detected_first=False)
        self._ailing = [node for node in self._nodes if node.counters.rec]

    def _fail(self, wire: list[_Offer], failure: Failure, when_us: int) -> None:
        """An error frame: count it at every node, and let the transmitters try again."""
        self._idle_ticks = self._start_ticks + failure.length_bits * TICKS_PER_BIT
        self._meter.error_frames += 1
        self._meter.occupy(-(-self._idle_ticks // self.bit_rate), failure.length_bits)
        self.recovery.bus_idle_from(self._idle_ticks)
        transmitters = [offer[2] for offer in wire]
        for node in self.delivery.listeners:
            if node not in transmitters:
                node.counters.reception_failed(detected_first=node in failure.detected_first)
        self._ailing = [node for node in self._nodes if node.counters.rec]
        for offer in wire:
            if offer[2].is_open:
                heapq.heappush(self._offers, offer)
        before = [node.counters.tec for node in transmitters]
        for node in transmitters:
            if failure.error is BusError.ACKNOWLEDGEMENT:
                node.counters.acknowledgement_missing()
            else:
                node.counters.transmission_failed()
            self._confine(node, self._idle_ticks)
        counters = transmitters[0].counters if transmitters else ErrorCounters()
        is_counted = not transmitters or before != [node.counters.tec for node in transmitters]
        self._announce(error_frame(failure.error, counters), when_us, is_counted=is_counted)

    # --- error states ------------------------------------------------------------------------------------------

    def _confine(self, node: SimulatedBus, over_ticks: int) -> None:
        """Draw the consequences for a transmitter whose frame is over, with intermission, at ``over_ticks``."""
        state = node.counters.state
        if not node.is_open or state is ErrorState.ERROR_ACTIVE:
            return
        if state is ErrorState.ERROR_PASSIVE:
            node.ready_ticks = over_ticks + SUSPEND_BITS * TICKS_PER_BIT
            if node not in self._suspended:
                self._suspended.append(node)
            return
        mine = [offer for offer in self._offers if offer[2] is node]
        node.held += [offer[3] for offer in sorted(mine, key=itemgetter(1))]
        self._withdraw(node)
        self._members_changed()
        delay_us = node.options.restart_after_us
        if delay_us is not None:
            self.clock.at_us(self.clock.now_us() + delay_us, lambda _now_us: node.restart())

    def _withdraw(self, node: SimulatedBus) -> None:
        self._offers = [offer for offer in self._offers if offer[2] is not node]
        heapq.heapify(self._offers)

    def _members_changed(self) -> None:
        self.delivery.listeners = [
            node for node in self._nodes if node not in self._joining and node.counters.state is not ErrorState.BUS_OFF
        ]
        self.delivery.forget_routes()

    def _announce(self, frame: Frame, when_us: int, *, is_counted: bool = True) -> None:
        counted = self._error_taps[ErrorsHeard.COUNTED] if is_counted else ()
        for callback in (*counted, *self._error_taps[ErrorsHeard.EVERY]):
            callback(frame, when_us, "")
        for node in list(self._nodes):
            if node.options.receive_errors:
                node.receive(frame, when_us)
