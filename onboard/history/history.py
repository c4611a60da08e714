"""A bus in one fold: feed it every message of the fleet bus, and let views take what it tells.

Here, and nowhere else for people's eyes, a message is looked at by its class. A view keeps what it shows; what was said
it asks here, and what a message has changed it takes from the fact that ``feed`` returns.
"""

from onboard.contract.battery import BatteryLevel
from onboard.contract.messages import (
    Award,
    Bid,
    Blocked,
    BusTime,
    CallForProposals,
    CarAt,
    Clear,
    Diagnostic,
    EmergencyStop,
    Halted,
    Heartbeat,
    Itinerary,
    ManualState,
    Message,
    Progress,
    TaskReport,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    Waiting,
)
from onboard.core.site import Site
from onboard.history.batteries import Batteries, BatteryTold
from onboard.history.calls import BidMade, CallAnswered, CallFact, CallOpened, CallRepeated, Calls
from onboard.history.clock import LoggedBusTime
from onboard.history.halts import Halts, HaltTold
from onboard.history.hands import Hands, HandTold
from onboard.history.lives import Beat, MachineLives, WaitTold
from onboard.history.loads import Loads, LoadTold
from onboard.history.orders import SiteOrders, SlotTold, StopTold
from onboard.history.places import Places, PlaceTold
from onboard.history.plans import Plans, PlanTold
from onboard.history.rights import RightsHistory, RightTold
from onboard.history.system import SystemFact, system_history
from onboard.history.tasks import TaskFold, TaskTold

#: Calls and tasks that are kept, so that a picture may stay open for ever: those that are over go first, the oldest of
#: them. A site of 24 machines has fewer than 20 open at a time, and what is asked about was lately.
CALL_LIMIT, TASK_LIMIT = 256, 256
#: A heartbeat in each so many us is what a site file says that says nothing of it (onboard/config).
UNKNOWN_BEAT_US = 2_000_000
#: What one message has told.
Fact = (
    CallOpened
    | CallRepeated
    | BidMade
    | CallAnswered
    | TaskTold
    | Beat
    | PlaceTold
    | PlanTold
    | LoadTold
    | WaitTold
    | HaltTold
    | HandTold
    | BatteryTold
    | SlotTold
    | StopTold
    | RightTold
    | SystemFact
)


class History:
    """The fold. ``is_bounded``: what is long over is forgotten, so that whoever listens may listen for ever.

    Without a site file no machine has a home, and the heartbeat period is ``UNKNOWN_BEAT_US``.
    """

    def __init__(self, site: Site | None, *, is_bounded: bool = True) -> None:
        machines = list(site.machines.values()) if site is not None else []
        self.clock = LoggedBusTime()
        self.lives = MachineLives(site.timing.heartbeat_us if site is not None else UNKNOWN_BEAT_US)
        self.places = Places(machines)
        self.plans = Plans()
        self.loads = Loads()
        self.rights = RightsHistory()
        self.hands = Hands()
        self.halts = Halts()
        self.batteries = Batteries()
        self.orders = SiteOrders(machines)
        self.calls = Calls(CALL_LIMIT if is_bounded else None, self.clock)
        self.tasks = TaskFold(TASK_LIMIT if is_bounded else None)
        self.system = system_history(site, self.tasks)

    def feed(self, message: Message, time_us: int) -> Fact | None:
        """Take up one message, at a time of the log in us; None where it tells nothing that is known here."""
        # Signs of life are three quarters of a bus.
        fact = self._of_sender(message, time_us) or self._deal(message, time_us) or self._of_site(message, time_us)
        if fact is None and self.system is not None:
            fact = self.system.feed(message, time_us)
        self.lives.heard_us[message.sender] = time_us
        return fact

    def _deal(self, message: Message, time_us: int) -> CallFact | TaskTold | None:
        """Calls, bids, awards, reports: what the machines deal out among themselves."""
        match message:
            case CallForProposals():
                opened = self.calls.on_call(message, time_us)
                if isinstance(opened, CallOpened):
                    self.tasks.on_call(opened)
                return opened
            case Bid():
                return self.calls.on_bid(message, time_us)
            case Award():
                answered = self.calls.on_award(message, time_us)
                self.tasks.on_answer(answered)
                return answered
            case TaskReport():
                self.calls.on_report(message, time_us)
                return self.tasks.on_report(message, time_us)
        return None

    def _of_sender(self, message: Message, time_us: int) -> Fact | None:
        """What a machine says of itself."""
        match message:
            case Heartbeat():
                return self._on_beat(message, time_us)
            case Progress():
                return self._on_progress(message, time_us)
            case Itinerary():
                self.calls.on_itinerary(message)
                return self.plans.on_itinerary(message)
            case Waiting():
                return self.lives.on_waiting(message, time_us)
            case ManualState():
                return self.hands.on_manual(message)
            case Diagnostic():
                self.lives.on_diagnostic(message)
            case BatteryLevel():
                return self.batteries.on_level(message)
        return None

    def _of_site(self, message: Message, time_us: int) -> Fact | None:
        """What is said of rights, loads, others, and of the site as a whole."""
        match message:
            case TokenGrant() | TokenHeld():
                return self.rights.on_word(message)
            case TokenRefusal():
                self.lives.on_refusal(message, time_us)
            case CarAt():
                return self.loads.on_car(message)
            case Halted():
                is_silent = self.lives.is_silent(message.machine, time_us)
                return self.halts.on_halted(message, time_us, is_silent=is_silent)
            case Blocked() | Clear():
                return self.orders.on_slot(message)
            case EmergencyStop():
                return self.orders.on_stop(message)
            case BusTime():
                self.clock.feed(message, time_us)
        return None

    def _on_beat(self, beat: Heartbeat, time_us: int) -> Beat:
        is_let_go, acts_again = self.hands.on_beat(beat), self.halts.on_beat(beat)
        ends_stop = self.orders.on_beat(beat)
        fact = self.lives.on_beat(beat, time_us, is_news=is_let_go or acts_again, ends_stop=ends_stop)
        if fact.is_restart:
            self.calls.on_restart(beat.sender, time_us)
        return fact

    def _on_progress(self, progress: Progress, time_us: int) -> PlaceTold:
        self.calls.on_progress(progress, time_us)
        self.plans.on_progress(progress)
        fact = self.places.on_progress(progress, time_us)
        self.halts.on_place(fact)
        self.lives.on_place(fact)
        return fact
