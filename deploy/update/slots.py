"""Which of the two root slots a board starts: the state that its boot loader and its own system share, and its rules.

The state is the boot loader's own: a GRUB environment block (GRUB manual 2.06, section 15.3, "The GRUB environment
block") of 1,024 bytes on the boot partition. It is always rewritten in place, and what it says fits into its first 512
bytes, so a power cut leaves the old or the new state. A state that cannot be read is that of a fresh image.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, auto

SLOTS = ("a", "b")
#: How often a new system is started that says nothing of itself: a power cut while it starts is no fault of its own.
ATTEMPTS = 3
#: File on the boot partition.
STATE_NAME = "slots.env"
STATE_BYTES = 1024
_HEAD = b"# GRUB Environment Block\n"
#: Bytes that the medium writes as one.
_SECTOR_BYTES = 512


class UpdatePhase(Enum):
    """How far an update has come."""

    SETTLED = auto()
    PENDING = auto()
    SPENT = auto()


class BoardEvent(Enum):
    """What happens to a board between two updates."""

    BEGUN = auto()
    INSTALLED = auto()
    STARTED = auto()
    HEALTHY = auto()
    UNHEALTHY = auto()
    FELL_BACK = auto()


@dataclass(frozen=True, slots=True)
class Slots:
    """``good`` is started unless ``tries`` attempts are left for ``trial``, which holds ``version``.

    ``failed`` is the version that was last given up, "" where none was.
    """

    good: str = "a"
    trial: str = ""
    tries: int = 0
    version: str = ""
    failed: str = ""

    @property
    def phase(self) -> UpdatePhase:
        """What the loader will do."""
        if not self.trial:
            return UpdatePhase.SETTLED
        return UpdatePhase.PENDING if self.tries > 0 else UpdatePhase.SPENT

    @property
    def next_start(self) -> str:
        """The slot that the loader starts next."""
        return self.trial if self.phase is UpdatePhase.PENDING else self.good


def other(slot: str) -> str:
    """The slot that is not this one."""
    return SLOTS[1 - SLOTS.index(slot)]


def _begin(state: Slots, _: str) -> Slots:
    return Slots(good=state.good, failed=state.failed)


def _install(state: Slots, version: str) -> Slots:
    return replace(state, trial=other(state.good), tries=ATTEMPTS, version=version)


def _attempt(state: Slots, _: str) -> Slots:
    return replace(state, tries=state.tries - 1)


def _settle(state: Slots, _: str) -> Slots:
    return Slots(good=state.trial)


def _spend(state: Slots, _: str) -> Slots:
    return replace(state, tries=0)


def _give_up(state: Slots, _: str) -> Slots:
    return Slots(good=state.good, failed=state.version)


def _stay(state: Slots, _: str) -> Slots:
    return state


#: What is not here cannot happen, and raises. An update may replace one that waits; from ``BEGUN`` on the other slot is
#: being written, so nothing may start it. ``STARTED`` is the boot loader's part (``deploy/image/files/grub.cfg``).
RULES: dict[tuple[UpdatePhase, BoardEvent], Callable[[Slots, str], Slots]] = {
    (UpdatePhase.SETTLED, BoardEvent.BEGUN): _begin,
    (UpdatePhase.PENDING, BoardEvent.BEGUN): _begin,
    (UpdatePhase.SPENT, BoardEvent.BEGUN): _begin,
    (UpdatePhase.SETTLED, BoardEvent.INSTALLED): _install,
    (UpdatePhase.SETTLED, BoardEvent.STARTED): _stay,
    (UpdatePhase.PENDING, BoardEvent.STARTED): _attempt,
    (UpdatePhase.SPENT, BoardEvent.STARTED): _stay,
    (UpdatePhase.PENDING, BoardEvent.HEALTHY): _settle,
    (UpdatePhase.SPENT, BoardEvent.HEALTHY): _settle,
    (UpdatePhase.PENDING, BoardEvent.UNHEALTHY): _spend,
    (UpdatePhase.SPENT, BoardEvent.UNHEALTHY): _spend,
    (UpdatePhase.SPENT, BoardEvent.FELL_BACK): _give_up,
    (UpdatePhase.PENDING, BoardEvent.FELL_BACK): _give_up,
}


def after(state: Slots, event: BoardEvent, version: str = "") -> Slots:
    """The state after an event; ``version`` is that of what was installed. Raises ``KeyError`` for what cannot be."""
    return RULES[state.phase, event](state, version)


def to_block(state: Slots) -> bytes:
    """The state as GRUB's environment block. Raises ``ValueError`` where it does not fit into one sector."""
    values = {
        "good": state.good,
        "trial": state.trial,
        "tries": str(state.tries),
        "version": state.version,
        "failed": state.failed,
    }
    said = _HEAD + "".join(f"{name}={value}\n" for name, value in values.items()).encode("ascii")
    if len(said) > _SECTOR_BYTES:
        raise ValueError(f"the slots' state takes {len(said)} bytes, more than one sector")
    return said.ljust(STATE_BYTES, b"#")


def from_block(block: bytes) -> Slots:
    """The state that a block holds; whatever is wrong with it, the state of a fresh image."""
    if len(block) != STATE_BYTES or not block.startswith(_HEAD):
        return Slots()
    lines = block[len(_HEAD) :].decode("ascii", "replace").split("\n")
    values = dict(line.split("=", 1) for line in lines if "=" in line and not line.startswith("#"))
    good, trial, tries = values.get("good", ""), values.get("trial", ""), values.get("tries", "")
    if good not in SLOTS or trial not in ("", other(good)) or not tries.isdecimal() or int(tries) > ATTEMPTS:
        return Slots()
    return Slots(good, trial, int(tries), values.get("version", ""), values.get("failed", ""))
