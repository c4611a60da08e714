"""What the controllers of a run did with tokens and calls, as steps of the models. Nothing here judges them."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Bid, TokenGrant, TokenHeld
from onboard.core.authority import TokenBook, TokenKey, genesis_holder
from onboard.core.effects import Effect, Record, Send
from onboard.core.negotiation.initiator import Initiator, InitiatorEvent, InitiatorState
from onboard.core.negotiation.participant import Participant, ParticipantEvent, ParticipantState

#: What each event of an initiator is called in the model.
_INITIATOR_STEPS = {
    InitiatorEvent.DEADLINE_WITH_BID: "decide()",
    InitiatorEvent.DEADLINE_EMPTY: "close_empty()",
    InitiatorEvent.EXHAUSTED: "close_empty()",
    InitiatorEvent.WITHDRAW: "withdraw()",
    InitiatorEvent.REPEAT: "award_again()",
    InitiatorEvent.HEARD: "heard_acting()",
    InitiatorEvent.FORFEIT: "given_back()",
    InitiatorEvent.ABANDON: "abandon()",
}


def _memory(book: TokenBook, key: TokenKey, node: int) -> str:
    """What a book remembers of a token, as the step that asks the model for the same."""
    leaving = book.leaving[key].version if key in book.leaving else 0
    at_first = key not in book.seen and genesis_holder(book.site, key) == book.node_id
    holds = str(key in book.held or at_first).lower()
    return f"expect({node}, {holds}, {book.seen.get(key, 0)}, {leaving})"


def _is_about(key: TokenKey, entry: Mapping[str, str | int]) -> bool:
    kinds = ("token_held", "token_given", "token_gone")
    return entry.get("record") in kinds and (entry["kind"], entry["number"]) == (int(key.kind), key.number)


_WAITING = (ParticipantState.WAITING_BOUND, ParticipantState.WAITING_COST, ParticipantState.ASKING)
Call = tuple[int, int]


@dataclass
class Recorder:
    """Steps by token and by call, in the order in which they happened; machines are numbered as they appear."""

    tokens: dict[TokenKey, list[str]] = field(default_factory=dict)
    calls: dict[Call, list[str]] = field(default_factory=dict)
    #: Which machine, by number, took each step of ``tokens``, and how often each token's machines crashed.
    doers: dict[TokenKey, list[int]] = field(default_factory=dict)
    crashes: Counter[TokenKey] = field(default_factory=Counter)
    nodes: dict[TokenKey, list[int]] = field(default_factory=dict)
    #: Apart from those: call 260 of node 1 and station 260 are the same pair of numbers.
    bidders: dict[Call, list[int]] = field(default_factory=dict)
    costs: dict[Call, dict[int, int]] = field(default_factory=dict)
    heard: dict[Call, set[tuple[int | str, int]]] = field(default_factory=dict)

    def index(self, thing: TokenKey | Call, node: int) -> int:
        """The number of a machine in one token's or call's steps."""
        known = self.nodes.setdefault(thing, []) if isinstance(thing, TokenKey) else self.bidders.setdefault(thing, [])
        if node not in known:
            known.append(node)
        return known.index(node)

    def attach(self, patch: pytest.MonkeyPatch) -> None:
        """Listen to every token book and negotiation until the patch is undone."""
        for name in ("give", "on_grant", "on_held", "on_given"):
            patch.setattr(TokenBook, name, self._token_listener(getattr(TokenBook, name)))
        patch.setattr(TokenBook, "replay", self._restart_listener(TokenBook.replay))
        patch.setattr(Participant, "_fire", self._participant_listener(Participant._fire))
        patch.setattr(Initiator, "_fire", self._initiator_listener(Initiator._fire))
        patch.setattr(Participant, "on_bid", self._bid_listener(Participant.on_bid))
        patch.setattr(Initiator, "on_bid", self._bid_listener(Initiator.on_bid))

    # --- tokens ------------------------------------------------------------------------------------------------

    def _token_listener(self, method: Callable[..., list[Effect]]) -> Callable[..., list[Effect]]:
        def listen(book: TokenBook, what: Any, *rest: Any) -> list[Effect]:
            key = what if isinstance(what, TokenKey) else TokenKey(what.token_kind, what.token)
            before = (book.seen.get(key), key in book.leaving)
            self.nodes.setdefault(key, [genesis_holder(book.site, key)])
            effects = method(book, what, *rest)
            if (book.seen.get(key), key in book.leaving) != before:
                self._token_steps(book, key, what, rest, effects)
            return effects

        return listen

    def _token_steps(self, book: TokenBook, key: TokenKey, what: Any, rest: Any, effects: list[Effect]) -> None:
        steps = self.tokens.setdefault(key, [])
        node = self.index(key, book.node_id)
        if isinstance(what, TokenKey):
            steps.append(f"give({node}, {self.index(key, rest[0])}, {book.seen[key]})")
        for effect in effects:
            if isinstance(effect, Record) and str(effect.entry["record"]).startswith("token_"):
                # Of what goes to the journal with a token, such as the place of a car, the model knows nothing.
                name = str(effect.entry["record"]).removeprefix("token_")
                decided = {"gone": f"confirmed({node})", "held": f"accept({node}, {effect.entry['version']})"}
                steps += [decided[name]] if name in decided else []
                steps.append(f"record_{name}({node})")
            elif isinstance(effect, Send) and isinstance(effect.message, TokenGrant):
                steps.append(f"send_grant({node})")
            elif isinstance(effect, Send) and isinstance(effect.message, TokenHeld):
                steps.append(f"state_held({node})")
        steps.append(_memory(book, key, node))
        doers = self.doers.setdefault(key, [])
        doers += [node] * (len(steps) - len(doers))

    def _restart_listener(self, replay: Callable[..., None]) -> Callable[..., None]:
        def listen(book: TokenBook, entries: Iterable[Mapping[str, str | int]]) -> None:
            entries = list(entries)
            replay(book, entries)
            for key in self.tokens:
                if book.node_id in self.nodes[key]:
                    self._restarted(book, key, [one for one in entries if _is_about(key, one)])

        return listen

    def _restarted(self, book: TokenBook, key: TokenKey, entries: list[Mapping[str, str | int]]) -> None:
        """Steps are noted when they are decided: what was not durable at the crash, and all after it, was not done.

        Frames that would have followed the last durable record may have left or not; the model allows for both.
        """
        node = self.nodes[key].index(book.node_id)
        # A car's first record is its creation, with which the model begins.
        made = key.kind is TokenKind.CAR and any(
            (one["record"], one["version"]) == ("token_held", 1) for one in entries
        )
        durable = len(entries) - made
        done: list[tuple[int, str]] = []
        records = 0
        for doer, step in zip(self.doers[key], self.tokens[key], strict=True):
            records += doer == node and step.startswith("record_")
            if doer != node or records <= durable:
                done.append((doer, step))
        assert records >= durable, f"node {book.node_id} has journalled more of {key} than it decided"
        done += [(node, f"crash({node})"), (node, f"restart({node})"), (node, _memory(book, key, node))]
        self.doers[key], self.tokens[key] = [doer for doer, _ in done], [step for _, step in done]
        self.crashes[key] += 1

    # --- calls -------------------------------------------------------------------------------------------------

    def _participant_listener(self, fire: Callable[..., Any]) -> Callable[..., Any]:
        def listen(one: Participant, event: ParticipantEvent, now_us: int) -> Any:
            before = one.state
            outcome = fire(one, event, now_us)
            if one.call.hold_ms == 0 and one.state is not before:
                self._participant_steps(one, before, event)
            return outcome

        return listen

    def _participant_steps(self, one: Participant, before: ParticipantState, event: ParticipantEvent) -> None:
        call = one.key
        steps, i = self.calls.setdefault(call, []), self.index(call, one.node_id)
        if before in _WAITING and one.state in _WAITING:
            return
        if one.state is ParticipantState.PRE_ASSIGNED:
            assert one.proposal is not None
            self.costs.setdefault(call, {})[i] = one.proposal.cost
            steps.append(f"bid({i})")
        elif event in (ParticipantEvent.AWARD_ME, ParticipantEvent.AWARD_OTHER):
            steps.append(f"hear_closing({i})")
        elif event is ParticipantEvent.SUPERSEDED:
            steps.append(f"superseded({i})")
        elif event is ParticipantEvent.LAPSE:
            steps.append(f"lapse({i})")
        elif before is ParticipantState.PRE_ASSIGNED and event is ParticipantEvent.DEADLINE:
            self._miss(call, i)
            steps.append(f"deadline({i})")
        elif event is ParticipantEvent.BEATEN and before is ParticipantState.PRE_ASSIGNED:
            return
        elif before in _WAITING:
            steps.append(f"quiet({i})")
        steps.append(f"expect({i}, {one.state.name})")
        if one.state is ParticipantState.ASSIGNED:
            steps.append(f"act({i})")

    def _miss(self, call: Call, receiver: int | str) -> None:
        """What a receiver has not heard when it decides, it has missed."""
        for i in self.costs.get(call, {}):
            if i != receiver and (receiver, i) not in self.heard.setdefault(call, set()):
                self.heard[call].add((receiver, i))
                self.calls[call].append(f"miss_bid({receiver}, {i})")

    def _initiator_listener(self, fire: Callable[..., Any]) -> Callable[..., Any]:
        def listen(one: Initiator, event: InitiatorEvent, now_us: int) -> Any:
            before = one.state
            if one.deadline_us is None and one.call is not None and before is not InitiatorState.CLOSED:
                self._initiator_steps(one, event)
            return fire(one, event, now_us)

        return listen

    def _initiator_steps(self, one: Initiator, event: InitiatorEvent) -> None:
        assert one.call is not None
        call = (one.node_id, one.call.call)
        steps = self.calls.setdefault(call, [])
        if event is InitiatorEvent.HEARD and one.state is not InitiatorState.AWARDING:
            return
        if event is InitiatorEvent.WITHDRAW and one.state is not InitiatorState.OPEN:
            return
        if event not in (InitiatorEvent.REPEAT, InitiatorEvent.HEARD, InitiatorEvent.FORFEIT, InitiatorEvent.WITHDRAW):
            self._miss(call, "INITIATOR")
        if event in _INITIATOR_STEPS:
            steps.append(_INITIATOR_STEPS[event])

    def _bid_listener(self, on_bid: Callable[..., Any]) -> Callable[..., Any]:
        def listen(one: Participant | Initiator, bid: Bid, now_us: int) -> Any:
            late = one.counters.late_bids_ignored
            outcome = on_bid(one, bid, now_us)
            is_whole = one.call is not None and one.call.hold_ms == 0
            if is_whole and one.counters.late_bids_ignored == late:
                call = (bid.initiator, bid.call)
                me: Any = "INITIATOR" if isinstance(one, Initiator) else self.index(call, one.node_id)
                bidder = self.index(call, bid.sender)
                self.heard.setdefault(call, set()).add((me, bidder))
                self.calls.setdefault(call, []).append(f"hear_bid({me}, {bidder})")
                if isinstance(one, Participant) and one.state not in _WAITING:
                    self.calls[call].append(f"expect({me}, {one.state.name})")
            return outcome

        return listen
