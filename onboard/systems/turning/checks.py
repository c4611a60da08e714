"""Rules of the turning cell, from the frames alone: bids equal their bills, an order is on one lathe, batches grow."""

from collections.abc import Callable

from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, Halted, Reference, TaskReport
from onboard.contract.turning import BillBar, BillCutting, BillWaiting, LathePhase, LatheProgress
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule

#: Five terms and their sum are rounded to cents one by one, ct.
ROUNDING_CT = 3
#: Who may not have heard that its order was taken back says for so long that it has it, us: its desk says the award of
#: today again at once, and a word that is lost on its way is said again within a second.
PATIENCE_US = 5_000_000
#: Who is silent is named again by the others within this, us: two heartbeats.
SAID_AGAIN_US = 4_000_000


class BillsAddUp(Rule):
    """The five terms that a lathe tells before its bid sum to the bid."""

    name = "bills-add-up"
    title = "the five terms of a bid sum to it"
    source = "row P26"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._terms: dict[tuple[int, Reference], dict[str, int]] = {}
        self._tasks: dict[tuple[int, int], Reference] = {}

    def handlers(self) -> Handlers:
        """Reads the three parts of a bill, calls and bids."""
        return {
            BillCutting: self._on_cutting,
            BillWaiting: self._on_waiting,
            BillBar: self._on_bar,
            CallForProposals: self._on_call,
            Bid: self._on_bid,
        }

    def _of(self, sender: int, manager: int, task: int) -> dict[str, int]:
        return self._terms.setdefault((sender, Reference(manager, task)), {})

    def _on_cutting(self, event: LogEvent[BillCutting]) -> None:
        word = event.message
        terms = self._of(word.sender, word.manager, word.task)
        terms["machining"], terms["tools"] = word.machining_ct, word.tools_ct

    def _on_waiting(self, event: LogEvent[BillWaiting]) -> None:
        word = event.message
        terms = self._of(word.sender, word.manager, word.task)
        terms["setup"], terms["latency"] = word.setup_ct, word.latency_ct

    def _on_bar(self, event: LogEvent[BillBar]) -> None:
        word = event.message
        terms = self._of(word.sender, word.manager, word.task)
        terms["material"] = word.material_ct
        if len(terms) == 5 and abs(sum(terms.values()) - word.total_ct) > ROUNDING_CT:
            self.find(event, (word.sender,), f"terms sum to {sum(terms.values())} ct, told {word.total_ct} ct")

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        self._tasks[event.message.sender, event.message.call] = event.message.task

    def _on_bid(self, event: LogEvent[Bid]) -> None:
        bid = event.message
        task = self._tasks.get((bid.initiator, bid.call))
        terms = self._terms.get((bid.sender, task), {}) if task is not None else {}
        if len(terms) == 5 and abs(sum(terms.values()) - bid.cost) > ROUNDING_CT:
            self.find(event, (bid.sender,), f"bids {bid.cost} ct, its terms sum to {sum(terms.values())} ct")


class BillsGoDown(BidsGoDown):
    """As everywhere; a bid that is not the sum of its bill does not count."""

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._totals_ct: dict[tuple[int, Reference], int] = {}

    def handlers(self) -> Handlers:
        """Reads bills beside what the rule for bids needs."""
        return {**super().handlers(), BillBar: self._on_bar}

    def _on_bar(self, event: LogEvent[BillBar]) -> None:
        word = event.message
        self._totals_ct[word.sender, Reference(word.manager, word.task)] = word.total_ct

    def is_sound(self, bid: Bid, task: Reference) -> bool:
        """The sum as it was told."""
        return self._totals_ct.get((bid.sender, task)) == bid.cost


class OneLathe(Rule):
    """An order that a lathe has told to have is told by no other, until it is given or taken back; its batch grows.

    Who was silent as an order was taken back from it, or was started again since, may not have heard so: that it has it
    is what its journal says, and the desk answers. That it has done it nobody else says but who is cut off.
    """

    name = "one-lathe"
    title = "every order is on one lathe, and its batch only grows"
    source = "row P11"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._owner: dict[Reference, int] = {}
        #: To whom it was awarded last, who may not have said that it has it.
        self._winner: dict[Reference, int] = {}
        #: From whom an order was taken back, and in which life it heard so; None where it was silent.
        self._lost: dict[tuple[Reference, int], int | None] = {}
        #: Since when it says all the same that it has it, us of the log.
        self._claimed_us: dict[tuple[Reference, int], int] = {}
        self._made: dict[Reference, int] = {}
        #: When another said last of a machine that it is silent, us of the log.
        self._silent_us: dict[int, int] = {}
        #: Who said while it was cut off that a task is done.
        self._done_unheard: set[tuple[Reference, int]] = set()

    def handlers(self) -> Handlers:
        """Reports, progress, what the desk takes back, and who is silent."""
        return {
            TaskReport: self._on_report,
            LatheProgress: self._on_progress,
            Award: self._on_award,
            Halted: self._on_halted,
        }

    def _on_halted(self, event: LogEvent[Halted]) -> None:
        if event.message.reason is Reason.NODE_SILENT:
            self._silent_us[event.message.machine] = event.time_us

    def _on_award(self, event: LogEvent[Award]) -> None:
        word = event.message
        if word.sender != word.task.origin:
            return
        if word.result is CallResult.AWARDED:
            self._winner[word.task] = word.winner
        owner = self._owner.get(word.task) or self._winner.get(word.task)
        if word.result is CallResult.REJECTED and owner is not None:
            self._owner.pop(word.task, None)
            life = self.picture.boots.get(owner)
            hears = self.picture.is_alive(owner, life) and not self._is_silent(owner)
            self._lost[word.task, owner] = life if hears else None
            self._claimed_us.pop((word.task, owner), None)

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        word = event.message
        if word.phase in (TaskPhase.FORFEITED, TaskPhase.REFUSED):
            if self._owner.get(word.task) == word.sender:
                del self._owner[word.task]
            return
        if self._owner.get(word.task, word.sender) != word.sender and self._is_unheard(word):
            return
        if word.phase is TaskPhase.AWARDED and word.task in self._owner and self._may_not_have_heard(word):
            return
        owner = self._owner.setdefault(word.task, word.sender)
        if owner != word.sender:
            what = f"tells to have order {word.task.origin}.{word.task.number}, which another has"
            self.find(event, (word.sender, owner), what)

    def _is_silent(self, node: int) -> bool:
        silent_us = self._silent_us.get(node)
        return silent_us is not None and self.picture.now_us - silent_us <= SAID_AGAIN_US

    def _is_unheard(self, word: TaskReport) -> bool:
        """Whether its sender is cut off, as the others say all the while; or was, as it said first that it is done."""
        is_silent = self._is_silent(word.sender)
        is_done = word.phase is TaskPhase.DONE
        if is_silent and is_done:
            self._done_unheard.add((word.task, word.sender))
        return is_silent or (is_done and (word.task, word.sender) in self._done_unheard)

    def _may_not_have_heard(self, word: TaskReport) -> bool:
        """Whether its sender was not there as the order was taken back from it, and has not been told for long."""
        key, life = (word.task, word.sender), self.picture.boots.get(word.sender)
        if self._lost.get(key, life) == life:
            return False
        return self.picture.now_us - self._claimed_us.setdefault(key, self.picture.now_us) <= PATIENCE_US

    def _on_progress(self, event: LogEvent[LatheProgress]) -> None:
        word = event.message
        task = Reference(word.manager, word.task)
        if word.made < self._made.get(task, 0) and word.lathe_phase is LathePhase.TURNING:
            self.find(event, (word.sender,), f"told {self._made[task]} parts made before, now {word.made}")
        if word.made > word.batch:
            self.find(event, (word.sender,), f"made {word.made} of {word.batch} parts")
        if word.lathe_phase in (LathePhase.TURNING, LathePhase.FINISHED):
            self._made[task] = max(word.made, self._made.get(task, 0))


#: What a turning cell's log is judged by: the rules of every system that apply, and its own.
RULES: tuple[type[Rule], ...] = (CallsClosed, BidsInTime, BillsGoDown, BillsAddUp, OneLathe)
