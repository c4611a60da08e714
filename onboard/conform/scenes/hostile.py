"""Frames that are wrong, and words of who may not say them: duties F2 and F3 of docs/protocol.md."""

from collections.abc import Callable, Iterator

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import Play, Stage
from onboard.contract.base import FrameCode, SetFrame
from onboard.contract.codes import KindCode, Reason
from onboard.contract.messages import Diagnostic, EmergencyStop, Heartbeat
from onboard.contract.packing import calls, plans, presence, rights
from onboard.core.frame import Frame
from onboard.wire.speakers import is_in

_WRONG = "a frame that is short, unknown or has a value out of its range is dropped and counted."
_UNHEARD = "All else is as if it had not been sent, and is counted (`NOT_OF_SITE`, `NOT_OF_KIND`, `NOT_AUTHORISED`)."
#: All messages that every system has.
FRAMES: tuple[FrameCode, ...] = (*presence.FRAMES, *rights.FRAMES, *calls.FRAMES, *plans.FRAMES)


def _refused(data: bytes) -> Iterator[FrameCode]:
    return (one for one in FRAMES if one.unpack(1, data) is None)


def _taken(one: FrameCode) -> bool:
    """Whether eight bytes of 0 are a message of its own."""
    return not issubclass(one.frame, SetFrame) and one.unpack(1, bytes(8)) is not None


def _word(name: str) -> str:
    """TokenGrant: token-grant."""
    return "".join(f"-{one.lower()}" if one.isupper() else one for one in name).removeprefix("-")


_SHORT = {f"short-{_word(one.name)}": one for one in FRAMES}
_RANGE = {f"wrong-value-in-{_word(one.name)}": one for one in _refused(b"\xff" * 8)}
#: What no compartment may say, and what a node that the site does not have says.
_KIND = {
    f"{_word(one.name)}-of-a-compartment": one
    for one in FRAMES
    if _taken(one) and not is_in(KindCode.COMPARTMENT, one.senders)
}
_SITE = {f"{_word(one.name)}-of-a-stranger": one for one in FRAMES if _taken(one) and one.frame is not EmergencyStop}


def _checks(names: dict[str, FrameCode], duty: str, sentence: str) -> tuple[Check, ...]:
    return tuple(Check(f"{name}-is-counted", duty, sentence) for name in names)


def _more(reason: Reason, before: int) -> Callable[[Diagnostic], bool]:
    return lambda one: one.reason is reason and one.count != before


def _one(stage: Stage, check: str, reason: Reason, frame: Frame) -> Play:
    """A frame that is to be counted once under ``reason``."""
    before, begin_us = stage.count_of(reason), stage.now_us
    stage.put(frame)
    told = yield from stage.hears(Diagnostic, _more(reason, before), 4.5)
    frames = (stage.shown(frame, begin_us), *((stage.shown(told.frame),) if told is not None else ()))
    more = 0 if told is None else told.message.count - before
    what = f"Diagnostic of {reason.name} says {more} more" if more else f"no Diagnostic of {reason.name} within 4.5 s"
    stage.findings.by_name[check].judge(what, frames, is_kept=more == 1)


def _counted(
    names: dict[str, FrameCode], reason: Reason, frame_of: Callable[[Stage, FrameCode], Frame]
) -> Callable[[Stage, Cast], Play]:
    """One frame after another, each of which is to be counted under ``reason``."""

    def play(stage: Stage, _: Cast) -> Play:
        for name, code in names.items():
            yield from _one(stage, f"{name}-is-counted", reason, frame_of(stage, code))

    return play


short = _counted(_SHORT, Reason.SHORT_FRAME, lambda stage, one: Frame(one.identifier | stage.caller, bytes(7)))
out_of_range = _counted(
    _RANGE, Reason.VALUE_OUT_OF_RANGE, lambda stage, one: Frame(one.identifier | stage.caller, b"\xff" * 8)
)
of_kind = _counted(_KIND, Reason.NOT_OF_KIND, lambda stage, one: Frame(one.identifier | stage.caller, bytes(8)))
of_site = _counted(_SITE, Reason.NOT_OF_SITE, lambda stage, one: Frame(one.identifier | stage.stranger, bytes(8)))

#: Wrong frames one behind the other, a tenth of a second apart.
_FLOOD = 40
UNKNOWN = (
    Check("unknown-message-is-counted", "F3", _WRONG),
    Check("standard-frame-is-counted", "F3", _WRONG),
    Check("remote-frame-is-counted", "F3", _WRONG),
    Check("node-0-is-counted", "F3", _WRONG),
    Check("empty-frame-is-counted", "F3", _WRONG),
    Check("a-flood-is-told-slowly", "F3", "at most once in `T_beat` for each reason."),
    Check("each-frame-of-a-flood-is-counted-once", "F3", _WRONG),
    Check("a-flood-stops-nothing", "F3", "What is heard never stops me"),
)


def unknown(stage: Stage, cast: Cast) -> Play:
    """Frames of no message, and a flood of wrong ones."""
    beat = stage.codec.identifier_of("Heartbeat")
    for name, reason, frame in (
        ("unknown-message-is-counted", Reason.UNKNOWN_IDENTIFIER, Frame(0x1FFF0000 | stage.caller, bytes(8))),
        ("standard-frame-is-counted", Reason.UNKNOWN_IDENTIFIER, Frame(0x123, bytes(8), is_extended=False)),
        (
            "remote-frame-is-counted",
            Reason.UNKNOWN_IDENTIFIER,
            Frame(beat | stage.caller, is_remote=True, remote_dlc=8),
        ),
        ("node-0-is-counted", Reason.UNKNOWN_IDENTIFIER, Frame(beat, bytes(8))),
        ("empty-frame-is-counted", Reason.SHORT_FRAME, Frame(beat | stage.caller, b"")),
    ):
        yield from _one(stage, name, reason, frame)
    begin_us, before = stage.now_us, stage.count_of(Reason.SHORT_FRAME)
    for number in range(_FLOOD):
        stage.put(Frame(beat | stage.caller, bytes(number % 8)))
        yield from stage.pause(0.1)
    told_all = [one for one in stage.since(Diagnostic, begin_us) if one.message.reason is Reason.SHORT_FRAME]
    stage.judge("a-flood-is-told-slowly", 1 <= len(told_all) <= 3, f"{len(told_all)} times in 4 s", *told_all)
    # The last count is told a heartbeat period behind the one before.
    yield from stage.pause(2.5)
    told_all = [one for one in stage.since(Diagnostic, begin_us) if one.message.reason is Reason.SHORT_FRAME]
    found = stage.count_of(Reason.SHORT_FRAME) - before
    stage.judge("each-frame-of-a-flood-is-counted-once", found == _FLOOD, f"{found} of {_FLOOD}", *told_all[-1:])
    alive = yield from stage.hears(Heartbeat, within_s=3.0)
    stage.judge("a-flood-stops-nothing", alive, "no heartbeat within 3 s", alive)
    _ = cast


SCENES = (
    Scene("short frames", _checks(_SHORT, "F3", _WRONG), short),
    Scene("values out of range", _checks(_RANGE, "F3", _WRONG), out_of_range),
    Scene("words of another kind", _checks(_KIND, "F2", _UNHEARD), of_kind),
    Scene("words of strangers", _checks(_SITE, "F2", _UNHEARD), of_site),
    Scene("no message at all", UNKNOWN, unknown),
)
