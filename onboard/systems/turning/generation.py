"""A lathe's half of the negotiation: the five-term cost of a job, by its own tools and setup (rows P21, P24, P26, P27).

It looks at no other machine: of the two kinds of task-generation functions in the paper this is the independent one.
"""

from dataclasses import dataclass, field, replace
from itertools import chain

from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Bid, CallForProposals, Message, Reference
from onboard.contract.turning import BillBar, BillCutting, BillWaiting, TurningOrder
from onboard.core.negotiation import CallKey, Proposal, RequestedTerms
from onboard.core.site import Machine, Site
from onboard.systems.turning.clamping import choose_clamping
from onboard.systems.turning.cost import Bill
from onboard.systems.turning.lathe import Lathe, LatheState, TurningJob
from onboard.systems.turning.process import Process, bar_eur, generate
from onboard.systems.turning.site import Turning

#: Most orders of others remembered; the oldest go first. An order is called for right after it is told.
MAX_KNOWN = 256
#: Dearest term that a frame can say, cents: 20 bits.
MAX_CENTS = (1 << 20) - 1


@dataclass
class LatheGeneration:
    """Estimates for calls of operation MACHINE, in cents for one part.

    ``state`` is kept by the machine from its sensors; ``in_hand`` are jobs won and not finished, ``promised`` those of
    standing bids: a bid is for the state in which they will leave the lathe.
    """

    site: Turning
    machine: Machine
    state: LatheState = field(default_factory=LatheState)
    in_hand: dict[Reference, TurningJob] = field(default_factory=dict)
    promised: dict[CallKey, TurningJob] = field(default_factory=dict)
    known: set[Reference] = field(default_factory=set)
    _told: dict[Reference, TurningJob] = field(default_factory=dict)
    #: The sums of the newest bills of others.
    _totals_ct: dict[tuple[int, Reference], int] = field(default_factory=dict)

    @property
    def lathe(self) -> Lathe:
        """This lathe as the site file describes it."""
        return self.site.lathes[self.machine.node_id]

    def hear(self, message: Message) -> None:
        """Take up what an order is, and what others would take for it."""
        if isinstance(message, BillBar):
            bill = (message.sender, Reference(message.manager, message.task))
            self._totals_ct.pop(bill, None)
            if len(self._totals_ct) >= MAX_KNOWN:
                del self._totals_ct[next(iter(self._totals_ct))]
            self._totals_ct[bill] = message.total_ct
        if isinstance(message, TurningOrder):
            task = Reference(message.sender, message.task)
            self._told.pop(task, None)
            if len(self._told) >= MAX_KNOWN:
                del self._told[next(iter(self._told))]
            self._told[task] = job_of(message)

    def is_sound(self, task: Reference, bid: Bid) -> bool:
        """Whether a bid is the sum of its bill."""
        return self._totals_ct.get((bid.sender, task)) == bid.cost

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """What the bar and its handling cost on the cheapest lathe; 0 where the order's frame was lost."""
        job = self._told.get(call.task)
        return 0 if job is None else least_cents(self.site, job)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The cost itself: working it out looks at nobody else."""
        process = self.process(call)
        return None if process is None else process.bill.total_cents

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The bid, with its five terms said before it."""
        process = self.process(call)
        if process is None:
            return None
        job = self._told[call.task]
        bill = bill_messages(self.machine.node_id, call.task, process.bill)
        return Proposal(process.bill.total_cents, None, (job,), (), (), bill)

    def process(self, call: CallForProposals) -> Process | None:
        """How this lathe would make a part of a call's order; None where it cannot, or has it in hand."""
        wanted = call.operation is Operation.MACHINE and call.criterion is Criterion.MONEY
        job = self._told.get(call.task) if wanted and call.task not in self.known else None
        if job is None:
            return None
        process = self.make(job, self.foreseen())
        if process is None or max(*(round(100 * term) for term in process.bill), process.bill.total_cents) > MAX_CENTS:
            return None
        return process

    def make(self, job: TurningJob, state: LatheState) -> Process | None:
        """The five stages for a job in a state of the lathe; None for a drawing or material that the site has not."""
        drawing, material = self.site.drawings.get(job.drawing), self.site.materials.get(job.material)
        if drawing is None or material is None:
            return None
        return generate(job, drawing, material, self.lathe, state)

    def foreseen(self) -> LatheState:
        """The lathe's state when all that it has won or offered is made."""
        state = LatheState(dict(self.state.used_min), self.state.set_up_for)
        for job in chain(self.in_hand.values(), self.promised.values()):
            process = self.make(job, state)
            if process is not None:
                state = after(job, process, state)
        return state


def turning(site: Site) -> Turning:
    """The site as what it is. Raises ``TypeError`` for another system's."""
    if not isinstance(site, Turning):
        raise TypeError(f"site {site.name} is no turning cell")
    return site


def least_cents(site: Turning, job: TurningJob) -> int:
    """What no lathe can be below for one part, in cents: bar, loading and unloading; all else depends on its state."""
    drawing, material = site.drawings.get(job.drawing), site.materials.get(job.material)
    if drawing is None or material is None:
        return 0
    least = []
    for lathe in site.lathes.values():
        clamping = choose_clamping(job, drawing, lathe)
        if clamping is not None:
            handling_eur = lathe.hourly_eur * (lathe.load_min + lathe.unload_min) / 60
            least.append(int(100 * (bar_eur(job, clamping, material) + handling_eur)))
    return min(least, default=0)


def longest_us(site: Turning, job: TurningJob) -> int:
    """The longest that any lathe takes between two words of its progress, us: for one part, and setting up for it."""
    drawing, material = site.drawings.get(job.drawing), site.materials.get(job.material)
    longest_min = 0.0
    for lathe in site.lathes.values() if drawing is not None and material is not None else ():
        assert drawing is not None and material is not None
        process = generate(job, drawing, material, lathe, LatheState())
        if process is not None:
            edges_min = lathe.edge_change_min * len(process.tools)
            own_min = lathe.setup_min + lathe.load_min + lathe.unload_min + edges_min
            longest_min = max(longest_min, process.machining_min + own_min)
    return round(60_000_000 * longest_min)


def after(job: TurningJob, process: Process, state: LatheState) -> LatheState:
    """The state in which a job leaves the lathe: what its edges have still to live, and what it is set up for."""
    left_min = {number: wear.left_min for number, wear in process.wear.items()}
    used = {tool.number: tool.life_min - left_min[tool.number] for tool in process.tools}
    return LatheState({**state.used_min, **used}, (job.drawing, process.clamping.chuck.name))


def job_of(message: TurningOrder) -> TurningJob:
    """The job that an order's message asks for, lengths in mm."""
    return TurningJob(message.drawing, message.material, message.bar_mm, message.batch, message.face_um / 1000)


def order_message(task: Reference, job: TurningJob) -> TurningOrder:
    """The message that asks for a job; lengths become whole um and mm."""
    face_um, bar_mm = round(job.face_mm * 1000), round(job.bar_mm)
    return TurningOrder(task.origin, task.number, job.drawing, job.material, job.batch, bar_mm, face_um)


def call_terms(task: Reference, job: TurningJob) -> RequestedTerms:
    """What a call for a job asks for; what the job is goes ahead in a frame of its own."""
    terms = RequestedTerms(
        task, Operation.MACHINE, KindCode.LATHE, Criterion.MONEY, ANY_STATION, ANY_STATION, Reference(*task), 0
    )
    return replace(terms, detail=(order_message(task, job),))


def bill_messages(node: int, task: Reference, bill: Bill) -> tuple[Message, ...]:
    """The five terms and their sum, in cents."""
    machining, tools, setup, material, latency = (round(100 * term) for term in bill)
    return (
        BillCutting(node, *task, machining, tools),
        BillWaiting(node, *task, setup, latency),
        BillBar(node, *task, material, bill.total_cents),
    )
