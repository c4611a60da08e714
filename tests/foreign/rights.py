"""Tokens as chapter 8 of docs/protocol.md has them, for a machine that gives back by itself what it does not need."""

from collections.abc import Callable
from dataclasses import dataclass, field

from tests.foreign.words import Signals, Word

Key = tuple[str, int]
Say = Callable[[str, Signals], None]
T_TOKEN, T_TOKEN_MOST, T_REFUSED = 200_000, 5_000_000, 1_000_000
_IN_LINE = 15


@dataclass
class Rights:
    """Times are bus time in us. ``first_holder`` is duty K1; ``journal`` stands for one that outlives a power cut."""

    node: int
    first_holder: Callable[[Key], int]
    say: Say
    held: dict[Key, int] = field(default_factory=dict)
    seen: dict[Key, int] = field(default_factory=dict)
    given: dict[Key, tuple[int, int]] = field(default_factory=dict)
    believed: dict[Key, tuple[int, int]] = field(default_factory=dict)
    #: Version, new holder, times said and when next.
    leaving: dict[Key, tuple[int, int, int, int]] = field(default_factory=dict)
    #: Times said and when next.
    wanted: dict[Key, tuple[int, int]] = field(default_factory=dict)
    disputed: dict[Key, Word] = field(default_factory=dict)
    asked: set[int] = field(default_factory=set)
    is_synced: bool = False
    journal: list[tuple[object, ...]] = field(default_factory=list)
    #: Of the itinerary in hand.
    version: int = 0
    #: C3: what goes before each repeat of a grant.
    before_grant: dict[Key, tuple[str, Signals]] = field(default_factory=dict)

    def holds(self, key: Key) -> bool:
        """Whether it is mine now."""
        return self.is_synced and (key in self.held or (key not in self.seen and self.first_holder(key) == self.node))

    def all_held(self) -> list[Key]:
        """What came to me."""
        return list(self.held) if self.is_synced else []

    def _belief(self, key: Key) -> tuple[int, int]:
        return self.believed.get(key, (0, self.first_holder(key)))

    def want(self, key: Key, now_us: int) -> None:
        """K9: ask, unless it is mine or asked for."""
        if not self.holds(key) and key not in self.wanted:
            self.wanted[key] = (0, now_us)

    def wake(self, now_us: int) -> None:
        """Say again what is due."""
        if not self.is_synced:
            return
        for key, (times, due_us) in self.wanted.items():
            if due_us <= now_us:
                self.wanted[key] = (times + 1, now_us + _pause_us(times + 1))
                seen = max(self.seen.get(key, 0), self._belief(key)[0]) & 0xFFFFF
                self.say("TokenRequest", {**_of(key), "version_seen": seen, **self._claim(key)})
        for key, (version, to, times, due_us) in self.leaving.items():
            if due_us <= now_us:
                self.leaving[key] = (version, to, times + 1, now_us + _pause_us(times + 1))
                if key in self.before_grant:
                    self.say(*self.before_grant[key])
                self.say("TokenGrant", {**_of(key), "version": version, "holder": to})

    def _claim(self, key: Key) -> Signals:
        return {"itinerary_version": self.version, "predecessor": 0}

    def next_due(self) -> int | None:
        """When ``wake`` has something to say."""
        times = [due for _, due in self.wanted.values()] + [one[3] for one in self.leaving.values()]
        return min(times, default=None) if self.is_synced else None

    def give(self, key: Key, to: int, now_us: int) -> None:
        """K3, K4: erase, journal, say."""
        own = self.held.get(key, self.seen.get(key, 0))
        version = max([own, *(self.held[one] for one in self._in_line(key))]) + 1
        self.held.pop(key, None)
        self.seen[key] = version
        self.given[key] = (version, to)
        self.believed[key] = (version, to)
        self.journal.append(("given", key, version, to))
        self.leaving[key] = (version, to, 1, now_us + T_TOKEN)
        self.say("TokenGrant", {**_of(key), "version": version, "holder": to})

    def _in_line(self, key: Key) -> list[Key]:
        found = []
        for step in (1, -1) if key[0] == "SEGMENT" else ():
            for away in range(1, _IN_LINE + 1):
                one = key[0], key[1] + step * away
                if one not in self.held or one[1] >> 8 != key[1] >> 8:
                    break
                found.append(one)
        return found

    def create(self, key: Key) -> None:
        """A token of mine that was none before."""
        self._hold(key, 1)

    def _hold(self, key: Key, version: int) -> None:
        self.journal.append(("held", key, version))
        self.held[key] = self.seen[key] = version
        self.believed[key] = (version, self.node)
        for table in (self.leaving, self.wanted, self.disputed):
            table.pop(key, None)

    # --- what is heard -----------------------------------------------------------------------------------------

    def hear(self, word: Word, now_us: int) -> None:
        """One word about one token."""
        key = word.signals["token_kind"], word.signals["token"]
        match word.name:
            case "TokenGrant" if word.signals["holder"] == self.node:
                self._offered(key, word)
            case "TokenGrant" | "TokenGiven":
                self._chain(key, word.sender, word.signals["version"], word.signals["holder"])
            case "TokenHeld":
                self._on_held(key, word)
            case "TokenRequest" if self.holds(key):
                signals = {"version": self.held.get(key, 0) & 0xFFFFF, "requester": word.sender}
                self.say("TokenRefusal", {**_of(key), **signals, "reason": "TOKEN_NOT_GRANTABLE_YET"})
            case "TokenRefusal" if word.signals["requester"] == self.node and key in self.wanted:
                soon = key[0] != "SEGMENT" or word.signals["reason"] == "MIRROR_BEHIND" or not self.version
                self.wanted[key] = (self.wanted[key][0], now_us + (T_REFUSED if soon else T_TOKEN_MOST))
            case "TokenDispute" if word.signals["believed"] == self.node:
                self._answer(key)

    def _offered(self, key: Key, word: Word) -> None:
        version = word.signals["version"]
        if not self.is_synced:
            return
        if version <= self.seen.get(key, 0) or self.holds(key):
            self._answer(key)
        elif word.sender == self._belief(key)[1]:
            if version > self._belief(key)[0]:
                self._hold(key, version)
                self.say("TokenHeld", {**_of(key), "version": version})
        else:
            self.disputed[key] = word
            self.say("TokenDispute", {**_of(key), "version": version, "believed": self._belief(key)[1]})

    def _chain(self, key: Key, giver: int, version: int, holder: int) -> None:
        if self.holds(key):
            self._answer(key)
        elif holder != self.node and giver == self._belief(key)[1] and version > self._belief(key)[0]:
            self._verified(key, version, holder)

    def _on_held(self, key: Key, word: Word) -> None:
        version, holder = word.signals["version"], word.sender
        if self.holds(key):
            self._answer(key)
        elif version >= self._belief(key)[0] and (holder == self._belief(key)[1] or holder in self.asked):
            self._verified(key, version, holder)

    def _verified(self, key: Key, version: int, holder: int) -> None:
        self.believed[key] = (version, holder)
        if key in self.leaving and version >= self.leaving[key][0]:
            self.journal.append(("gone", key, self.leaving.pop(key)[0]))
            self.before_grant.pop(key, None)
        waiting = self.disputed.pop(key, None)
        if waiting is not None:
            self._offered(key, waiting)

    def _answer(self, key: Key) -> None:
        if self.holds(key):
            self.say("TokenHeld", {**_of(key), "version": self.held.get(key, 0)})
        elif key in self.given:
            self.say("TokenGiven", {**_of(key), "version": self.given[key][0], "holder": self.given[key][1]})

    def statements(self) -> None:
        """R1, R3."""
        for key, version in self.held.items():
            self.say("TokenHeld", {**_of(key), "version": version})
        for key, (version, to, _, _) in self.leaving.items():
            self.say("TokenGiven", {**_of(key), "version": version, "holder": to})


def _of(key: Key) -> Signals:
    return {"token_kind": key[0], "token": key[1]}


def _pause_us(times: int) -> int:
    return T_TOKEN if times <= 3 else min(T_TOKEN_MOST, T_TOKEN << min(times - 3, 10))
