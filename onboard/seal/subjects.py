"""What of the fleet bus is sealed, to whom, and which signs of life do without."""

from collections.abc import Callable

from onboard.contract.codes import MachineState, Reason, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, CarAt, Heartbeat, Message, TokenGrant
from onboard.contract.packing.seal import FRAMES
from onboard.core.frame import Frame

#: What a frame says, or why it says nothing (``Codec.decode_part``).
Reading = Callable[[Frame], Message | Reason]

_CODES = {one.frame: one for one in FRAMES}
#: A sign of life that says nothing new of its sender is sealed when nothing was for so long, us.
UNSEALED_FOR_US = 40_000_000
#: Cars whose last place is kept.
_CARS_KEPT = 4_096


def frame_of(word: Message) -> Frame:
    """The frame of a word of ``dbc/seal.dbc``."""
    code = _CODES[type(word)]
    return Frame(code.identifier | word.sender, code.pack(word))


def taker_of(word: Message | Reason) -> int:
    """Who acts on a word because it is named there; NOBODY for what all take alike."""
    if isinstance(word, TokenGrant):
        return word.holder
    return word.winner if isinstance(word, Award) else NOBODY


def life_told(beat: Heartbeat) -> tuple[int, ...]:
    """What a sign of life says of its sender itself; a digest of what all know costs others a question at most.

    Idle or working is one: no machine acts on which (``regeneration`` asks for either), and it changes with each task.
    """
    state = MachineState.IDLE if beat.state is MachineState.WORKING else beat.state
    return beat.contract, beat.site_digest, beat.boot, beat.kind, state, beat.epoch


class CarPlaces:
    """Where one sender last said that each car stands: a grant of a car's token is sealed together with it."""

    def __init__(self) -> None:
        self._frames: dict[int, Frame] = {}

    def note(self, word: Message | Reason, frame: Frame) -> None:
        """Take up a word of the sender."""
        if isinstance(word, CarAt):
            token = word.car.origin << 16 | word.car.number
            self._frames.pop(token, None)
            self._frames[token] = frame
            if len(self._frames) > _CARS_KEPT:
                del self._frames[next(iter(self._frames))]

    def forget(self) -> None:
        """The sender's next life begins with nothing said."""
        self._frames.clear()

    def with_grant(self, word: Message | Reason, frame: Frame) -> tuple[Frame, ...]:
        """All that the taker's seal of a frame is over."""
        if isinstance(word, TokenGrant) and word.token_kind is TokenKind.CAR and word.token in self._frames:
            return self._frames[word.token], frame
        return (frame,)
