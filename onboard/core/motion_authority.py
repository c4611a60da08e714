"""The one function that permits motion (design, section 5), and the one place that makes the orders for it.

A machine asks ``authorised`` with the rights that a movement needs, and its answer makes the order: nothing else does.
The holon looks at what goes out all the same. An order that was made without an answer of this very event, or under no
right where the system says that one is needed, is not carried out: the machine stops and says why.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from onboard.contract.codes import Reason
from onboard.contract.messages import Message
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.effects import Actuate, Effect, Tell
from onboard.core.site import MotionNeeds

#: The rights of whoever moves within itself only.
ALONE: tuple[TokenKey, ...] = ()


def acts() -> Reason:
    """A machine that nothing holds."""
    return Reason.NONE


@dataclass
class MotionAuthority:
    """What ``authorised`` looks at on one machine: the tokens held, and why it may not move anything at all, if so."""

    tokens: TokenBook
    why_still: Callable[[], Reason] = acts
    #: Events that this machine has dealt with: a permit is good in its own and in no later one.
    event: int = 0

    def fault(self, effects: Iterable[Effect], moved_by: Mapping[str, MotionNeeds]) -> str | None:
        """What is wrong with the first order among ``effects`` that must not go out, None where there is none.

        ``moved_by`` are the orders by which something moves in this system, and what each needs. Ends the event.
        """
        found = [why for effect in effects if (why := self._why_not_out(effect, moved_by)) is not None]
        self.event += 1
        return found[0] if found else None

    def _why_not_out(self, effect: Effect, moved_by: Mapping[str, MotionNeeds]) -> str | None:
        if isinstance(effect, Tell):
            name = type(effect.message).__name__
            return f"{name} moves something and is told as if it did not" if name in moved_by else None
        if not isinstance(effect, Actuate):
            return None
        name, permit = type(effect.message).__name__, effect.permit
        if not isinstance(permit, Permit) or permit.motion is not self or permit.event != self.event or not permit:
            return f"{name} was not authorised"
        if name not in moved_by:
            return f"{name} is no order of this system"
        if any(not self.tokens.holds(key) for key in permit.rights):
            return f"{name} goes out when its right is given away"
        return f"{name} needs a right" if moved_by[name] is MotionNeeds.RIGHT and not permit.rights else None


@dataclass(frozen=True, slots=True)
class Permit:
    """The answer: ``reason`` is NONE where the machine may move now under ``rights``, else why it may not."""

    motion: MotionAuthority
    event: int
    reason: Reason
    rights: tuple[TokenKey, ...]

    def __bool__(self) -> bool:
        """Whether it permits."""
        return self.reason is Reason.NONE

    def again(self) -> "Permit":
        """The answer now to what was asked then."""
        return authorised(self.motion, self.rights)

    def unless(self, lacks: Reason) -> "Permit":
        """The same, but for what else is missing: nobody said that what it enters is there."""
        return self if lacks is Reason.NONE or not self else replace(self, reason=lacks)

    def order(self, message: Message) -> list[Effect]:
        """The order to the device; nothing where there is no permission."""
        return [Actuate(message, self)] if self else []


def authorised(
    motion: MotionAuthority, rights: Iterable[TokenKey], own: Reason = Reason.NONE, *, besides: Permit | None = None
) -> Permit:
    """Whether this machine may move now where ``rights`` let it, and if not, why not.

    Asked before every movement order and again while the movement runs; nothing else permits motion. ``own`` is what
    the machine itself has against it, such as a position that it does not know; ``besides`` what was permitted before
    in this event, where this is for more than that.
    """
    before, others = (motion.why_still(), ALONE) if besides is None else (besides.reason, besides.rights)
    reason, rights, tokens = before or own, tuple(rights), motion.tokens
    if reason is Reason.NONE:
        missing = next((key for key in rights if not tokens.holds(key)), None)
        reason = Reason.NONE if missing is None else tokens.refused.get(missing, Reason.NOT_AUTHORISED)
    return Permit(motion, motion.event, reason, (*others, *rights))
