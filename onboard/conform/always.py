"""What is judged of every frame that the node says, whatever is played: duties F1 to F3, J2 to J4, K3 to K5, R3."""

from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.stage import MS, SECOND, Stage, Word, after_ms
from onboard.contract.codes import CONTRACT_VERSION, Grade, MachineState, TokenKind
from onboard.contract.constants import ACTING
from onboard.contract.messages import (
    Bid,
    BusTime,
    CarAt,
    Diagnostic,
    Heartbeat,
    Itinerary,
    ItineraryHead,
    ItineraryLeg,
    SyncDone,
    TokenGrant,
    TokenHeld,
    TokenRequest,
)
from onboard.core.serial import is_newer
from onboard.core.token_keys import TokenKey, genesis_holder
from onboard.wire.pace import SHARES

_SHARES: dict[str, tuple[type, int]] = {
    "share-of-requests": (TokenRequest, 4),
    "share-of-heads": (ItineraryHead, 3),
    "share-of-legs": (ItineraryLeg, 16),
    "share-of-heartbeats": (Heartbeat, 5),
    "share-of-diagnostics": (Diagnostic, 1),
}
_SHARE = (
    "what all may say together in the long run are 4 % of it `TokenRequest`, 3 % "
    "`ItineraryHead`, 16 % `ItineraryLeg`, 5 % `Heartbeat` and 1 % `Diagnostic`, "
    "divided by the machines of the site."
)
#: Bits of a frame of 8 bytes with 29-bit identifier without stuffing, and the least of a play for a share to be judged.
_FRAME_BITS, _LONG_RUN_US = 131, 60 * SECOND
#: Grants that follow each other so soon are given in one go.
_ONE_GO_US = 20 * MS
_HELD = "A token leaves by its holder's own hand"

ALWAYS = (
    Check(
        "frames-are-of-8-bytes",
        "F1",
        ("All frames are classic CAN 2.0B data frames with 29-bit identifiers and 8 bytes"),
    ),
    Check(
        "frames-are-messages", "F1", ("All frames are classic CAN 2.0B data frames with 29-bit identifiers and 8 bytes")
    ),
    Check("unused-bits-are-0", "F1", "Bits that no signal has are sent as 0 and not looked at."),
    Check(
        "says-only-what-its-kind-says",
        "F2",
        ("each only with messages whose senders in the DBC (`BO_TX_BU_`) name its kind"),
    ),
    Check("says-no-bus-time", "T2", "Who does not say it follows"),
    Check("head-comes-before-legs", "F4", "of an itinerary the head first"),
    Check("legs-come-in-time", "F4", "After `T_set` without a frame of it a set is dropped."),
    *(Check(name, "F9", _SHARE) for name in _SHARES),
    Check("heartbeats-come-in-time", "J2", "I say `Heartbeat` every `T_beat`"),
    Check("heartbeats-keep-apart", "J2", "but not sooner than `T_apart` after the last"),
    Check(
        "heartbeats-have-their-turn",
        "J2",
        ("at an offset of my rank among the site's node-IDs (from 0) times `T_beat` divided by their number."),
    ),
    Check(
        "heartbeat-follows-a-change",
        "J2",
        ("A word of mine that changes digests is followed by a heartbeat after `T_tell`"),
    ),
    Check("heartbeat-tells-the-contract", "J3", "`contract` is that of [chapter 16](#16-the-contracts-number)"),
    Check(
        "heartbeat-tells-the-site", "J3", ("`site_digest` is the site file's ([its digest](site-file.md#the-digest))")
    ),
    Check("heartbeat-tells-the-kind", "J3", "`kind` is the site file's."),
    Check("heartbeat-tells-the-epoch", "J3", "`epoch` is 0 until rights are [made anew](#14-regeneration)."),
    Check("heartbeat-tells-the-mirror", "J4", "`mirror_digest` is the CRC-16/CCITT-FALSE"),
    Check("one-boot-a-life", "J1", "`boot` is kept in the journal and grows with each life"),
    Check("plan-version-is-newer", "P1", ("A robot has one firm itinerary, under `version`, newer with each change")),
    Check("bids-improve", "B5", "So the bids of one call strictly improve on the bus."),
    Check("grants-only-what-it-holds", "K3", _HELD),
    Check("grants-under-newer-versions", "K3", "then say `TokenGrant` with a new version and the new holder."),
    Check(
        "grants-of-a-line-have-one-version",
        "K4",
        ("of a segment one more than the highest among those in line with it (15 to either side) that I hold too"),
    ),
    Check("grants-to-machines-of-the-site", "K3", "then say `TokenGrant` with a new version and the new holder."),
    Check("holds-only-what-it-was-given", "K5", "A grant counts if it names me"),
    Check("diagnostics-keep-apart", "F3", "at most once in `T_beat` for each reason."),
    Check("car-at-only-in-its-custody", "C2", "by its custodian only."),
    Check("answers-name-a-node", "R3", "then `SyncDone` naming who asked."),
)


@dataclass
class Always:
    """The judge of all words; made once for a play."""

    stage: Stage
    cast: Cast
    last: dict[type, Word] = field(default_factory=dict)
    #: Tokens that the node has by its own words, and their versions.
    held: dict[TokenKey, int] = field(default_factory=dict)
    #: The last give of each token by the node: version and holder.
    given: dict[TokenKey, tuple[int, int]] = field(default_factory=dict)
    #: What it held when it began to give segments away, and when it last did.
    line: dict[TokenKey, int] = field(default_factory=dict)
    line_us: int = -SECOND
    bids: dict[tuple[int, int], Word] = field(default_factory=dict)
    diagnostics: dict[int, Word] = field(default_factory=dict)
    plan: Word | None = None
    boots: dict[int, Word] = field(default_factory=dict)
    #: The last heartbeat that came at the node's own offset.
    in_turn: Word | None = None
    #: Heartbeats in a row with another digest than that of the fleet; who starts says several in one moment.
    wrong_digests: list[Word] = field(default_factory=list)

    def __post_init__(self) -> None:
        site, node = self.stage.site, self.stage.node
        home = TokenKey(TokenKind.SEGMENT, site.machines[node].home.number)
        if genesis_holder(site, home) == node:
            self.held[home] = 0
        # Before the fleet takes a word up: a grant is judged by what the node held before it.
        self.stage.hearers.insert(0, self.hear)
        self.stage.closers.append(self.close)
        self.by_kind: dict[type, Callable[[Word], None]] = {
            Heartbeat: self._on_beat,
            Itinerary: self._on_plan,
            Bid: self._on_bid,
            TokenGrant: self._on_grant,
            TokenHeld: self._on_held,
            Diagnostic: self._on_diagnostic,
            CarAt: self._on_car,
            SyncDone: self._on_done,
            ItineraryLeg: self._on_leg,
        }

    def hear(self, word: Word) -> None:
        """One word of the node."""
        stage, kind = self.stage, type(word.message)
        frame = word.frame
        is_whole = frame.is_extended and not frame.is_remote and len(frame.data) == 8
        stage.judge("frames-are-of-8-bytes", is_whole, "another frame", word)
        if kind in stage.codec.wholes:
            said = stage.codec.decode_part(frame)
            if not isinstance(said, int):
                same = stage.codec.encode(said)[0].data
                stage.judge("unused-bits-are-0", same == frame.data, f"{same.hex()} would say the same", word)
        kinds = stage.codec.speakers.get(kind)
        if kinds is not None:
            stage.judge("says-only-what-its-kind-says", stage.machine.kind in kinds, "not of its kind", word)
        if kind in self.by_kind:
            self.by_kind[kind](word)
        self.last[kind] = word

    # --- presence ------------------------------------------------------------------------------------------------

    def _on_beat(self, word: Word) -> None:
        stage, beat = self.stage, word.message
        before = self.last.get(Heartbeat)
        if before is not None and before.message.boot == beat.boot:
            gap_us, beat_us = word.time_us - before.time_us, stage.site.timing.heartbeat_us
            slack_us = 4 * stage.means.late_us
            stage.judge("heartbeats-come-in-time", gap_us <= beat_us + slack_us, f"{gap_us} us", before, word)
            is_same = before.message.state is beat.state and beat.state in ACTING
            if is_same and not self._is_in_turn(word):
                # Who starts, is held or goes on says so at once.
                is_apart = gap_us >= 300 * MS - stage.means.late_us
                stage.judge("heartbeats-keep-apart", is_apart, f"{gap_us} us", before, word)
            self._turn(word)
        stage.judge("heartbeat-tells-the-contract", beat.contract == CONTRACT_VERSION, f"not {CONTRACT_VERSION}", word)
        stage.judge("heartbeat-tells-the-site", beat.site_digest == stage.site.digest, f"not {stage.site.digest}", word)
        stage.judge("heartbeat-tells-the-kind", beat.kind is stage.machine.kind, "another kind", word)
        stage.judge("heartbeat-tells-the-epoch", beat.epoch <= stage.epoch, f"the epoch is {stage.epoch}", word)
        known = self.boots.setdefault(beat.boot, word)
        is_one = not any(b.time_us > known.time_us for boot, b in self.boots.items() if boot != beat.boot)
        stage.judge("one-boot-a-life", is_one, "an earlier life's boot", known, word)
        self._digest(word)

    def _is_in_turn(self, word: Word) -> bool:
        stage, nodes = self.stage, sorted(self.stage.site.machines)
        beat_us = stage.site.timing.heartbeat_us
        bus_us = word.time_us - stage.now_us + stage.bus_us
        away_us = (bus_us - nodes.index(stage.node) * beat_us // len(nodes)) % beat_us
        return min(away_us, beat_us - away_us) <= 2 * stage.means.late_us

    def _turn(self, word: Word) -> None:
        stage, before = self.stage, self.in_turn
        if self._is_in_turn(word) or (before is not None and before.message.state is not word.message.state):
            self.in_turn = word
        is_one = before is not None and before.message.state is word.message.state
        # Who starts may not know bus time yet.
        is_one = is_one and word.message.state is not MachineState.STARTING
        if before is not None and is_one and before.message.boot == word.message.boot:
            gap_us = word.time_us - before.time_us
            is_kept = gap_us <= stage.site.timing.heartbeat_us + 4 * stage.means.late_us
            stage.judge("heartbeats-have-their-turn", is_kept, f"none in its turn for {gap_us} us", before, word)

    def _digest(self, word: Word) -> None:
        """Three words in a row with another digest, while nothing changes, are wrong: one may cross what it tells."""
        if word.message.state is MachineState.STARTING or word.message.mirror_digest == self.cast.digest():
            self.wrong_digests.clear()
            if word.message.state is not MachineState.STARTING:
                self.stage.judge("heartbeat-tells-the-mirror", True, "")
            return
        self.wrong_digests.append(word)
        lasts_us = word.time_us - self.wrong_digests[0].time_us
        if len(self.wrong_digests) >= 3 and lasts_us > self.stage.site.timing.heartbeat_us:
            what = f"{self.cast.digest():04X} would be right"
            self.stage.judge("heartbeat-tells-the-mirror", False, what, word)

    def _on_plan(self, word: Word) -> None:
        if word.message.grade is not Grade.FIRM:
            return
        before, self.plan = self.plan, word
        if before is not None and self._is_one_life(before, word):
            old, new = before.message, word.message
            is_kept = is_newer(new.version, old.version, 8) or (new.version, new.legs) == (old.version, old.legs)
            self.stage.judge("plan-version-is-newer", is_kept, "another plan, no newer version", before, word)

    def _is_one_life(self, first: Word, then: Word) -> bool:
        return not any(first.time_us < one.time_us <= then.time_us for one in self.boots.values())

    def _on_leg(self, word: Word) -> None:
        head = self.last.get(ItineraryHead)
        is_behind = head is not None and head.message.version == word.message.version
        self.stage.judge("head-comes-before-legs", is_behind, "no head of its version before it", head, word)
        if is_behind and head is not None:
            before = self.last.get(ItineraryLeg)
            begin_us = max(head.time_us, 0 if before is None else before.time_us)
            self.stage.judge("legs-come-in-time", word.time_us - begin_us <= SECOND, "after T_set", head, word)

    def _on_bid(self, word: Word) -> None:
        key = (word.message.initiator, word.message.call)
        before = self.bids.get(key)
        if before is not None:
            is_better = after_ms(word.message.cost, before.message.cost) < 0
            self.stage.judge("bids-improve", is_better, "no better than its last", before, word)
        else:
            self.stage.judge("bids-improve", True, "", word)
        self.bids[key] = word

    def _on_diagnostic(self, word: Word) -> None:
        before = self.diagnostics.get(word.message.reason)
        if before is not None and self._is_one_life(before, word):
            gap_us = word.time_us - before.time_us
            least_us = self.stage.site.timing.heartbeat_us - self.stage.means.late_us
            self.stage.judge("diagnostics-keep-apart", gap_us >= least_us, f"{gap_us} us", before, word)
        self.diagnostics[word.message.reason] = word

    def _on_done(self, word: Word) -> None:
        known = word.message.whom in (0, *self.stage.site.machines, *range(251, 256))
        self.stage.judge("answers-name-a-node", known, "no node of the site", word)

    # --- rights --------------------------------------------------------------------------------------------------

    def _on_grant(self, word: Word) -> None:
        said: TokenGrant = word.message
        key = TokenKey(said.token_kind, said.token)
        is_again = self.given.get(key) == (said.version, said.holder)
        is_its = is_again or key in self.held or self.cast.holder(key)[0] == self.stage.node
        self.stage.judge("grants-only-what-it-holds", is_its, "it does not hold it", word)
        if not is_again:
            before = self.held.get(key, self.cast.holder(key)[1])
            self.stage.judge("grants-under-newer-versions", said.version > before, f"not above {before}", word)
        if not is_again and key.kind is TokenKind.SEGMENT and key in self.held:
            self._on_line(word, key)
        is_known = said.holder in self.stage.site.machines and said.holder != self.stage.node
        self.stage.judge("grants-to-machines-of-the-site", is_known, "to nobody of the site", word)
        self.held.pop(key, None)
        self.given[key] = (said.version, said.holder)

    def _on_line(self, word: Word, key: TokenKey) -> None:
        """One that leaves with others, in one frame or one after another, has the version that all have."""
        if word.time_us - self.line_us > _ONE_GO_US:
            self.line = dict(self.held)
        self.line_us = word.time_us
        # What leaves a moment later has no part in it.
        wanted = {self._in_line(self.line, key) + 1, self._in_line(self.held, key) + 1}
        is_one = word.message.version in wanted
        self.stage.judge("grants-of-a-line-have-one-version", is_one, f"not {sorted(wanted)}", word)

    def _in_line(self, versions: dict[TokenKey, int], key: TokenKey) -> int:
        """The highest version of those in line with a segment."""
        found = [versions.get(key, self.held.get(key, 0))]
        for step in (-1, 1):
            number = key.number + step
            while TokenKey(key.kind, number) in versions and abs(number - key.number) <= 15:
                found.append(versions[TokenKey(key.kind, number)])
                number += step
        return max(found)

    def _on_held(self, word: Word) -> None:
        said: TokenHeld = word.message
        key = TokenKey(said.token_kind, said.token)
        flight = self.cast.flights.get(key)
        holder, version = self.cast.holder(key)
        is_given = holder == self.stage.node or key in self.held or flight is not None
        if self.stage.means.power:
            # Who was not switched on by the kit may have rights of which the kit has not heard.
            is_known = is_given or version < said.version
            self.stage.judge("holds-only-what-it-was-given", is_known, f"node {holder} has it", word)
        self.held[key] = said.version
        self.given.pop(key, None)

    def _on_car(self, word: Word) -> None:
        key = TokenKey(TokenKind.CAR, word.message.car.origin << 16 | word.message.car.number)
        version = self.held.get(key, self.given.get(key, (0, 0))[0] - 1)
        is_its = version & 0xFFFF == word.message.version
        self.stage.judge("car-at-only-in-its-custody", is_its, f"its token has version {version}", word)

    # --- the end -------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """What only the whole play tells."""
        stage = self.stage
        shown = tuple(one for one, _ in stage.wrong)
        said = bool(stage.said_since(0))
        if said:
            what = ", ".join(sorted({why.name for _, why in stage.wrong}))
            stage.findings.by_name["frames-are-messages"].judge(what, shown, is_kept=not shown)
            stage.judge("says-no-bus-time", not stage.words[BusTime], "says BusTime", *stage.words[BusTime])
        span_us = stage.now_us - stage.begin_us
        for name, (kind, per_cent) in _SHARES.items():
            if span_us >= _LONG_RUN_US and said:
                frames = len({(one.time_us, one.frame) for one in stage.words[kind]})
                load = frames * _FRAME_BITS * SECOND / span_us / stage.site.bitrate * 100
                most = per_cent / SHARES[kind.__name__].among(stage.site)
                stage.judge(name, load <= most, f"{load:.2f} % of the bus, where {most:.2f} % are its share")
        self._changes()

    def _changes(self) -> None:
        """Behind each word that changes digests there is a heartbeat, but for what was cut off."""
        stage, beats = self.stage, self.stage.words[Heartbeat]
        plans = [one for one in stage.words[Itinerary] if one.message.grade is Grade.FIRM]
        versions: set[int] = set()
        for word in plans:
            if word.message.version in versions:
                continue
            versions = {word.message.version}
            limit_us = word.time_us + 400 * MS + 4 * stage.means.late_us
            follows = [one for one in beats if word.time_us <= one.time_us <= limit_us]
            if limit_us < stage.now_us:
                stage.judge("heartbeat-follows-a-change", follows, "none within 0.4 s", word)


def watch(stage: Stage, cast: Cast) -> None:
    """Judge all that is said from now on."""
    Always(stage, cast)
