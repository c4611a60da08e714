"""How a robot of the cell takes a part up and puts it down: its gripper's last word, and the order that it has."""

from dataclasses import dataclass, field

from onboard.contract.cell import GripAction, GripMode
from onboard.contract.cell_device import GripOrder, GripState
from onboard.contract.messages import Reference
from onboard.core.effects import Effect
from onboard.core.motion_authority import MotionAuthority, authorised
from onboard.systems.cell.contracts import part_token
from onboard.work.device_link import DeviceLink

#: An order to the gripper is said again after this while it is not obeyed, us (dbc/cell.dbc).
GRIP_AGAIN_US = 1_000_000


@dataclass
class ArmGripper:
    """One robot's gripper. ``state`` is what its sensor said last; None before it has said anything."""

    motion: MotionAuthority
    node_id: int
    state: GripState | None = None
    link: DeviceLink[tuple[GripAction, Reference]] = field(init=False)

    def __post_init__(self) -> None:
        self.link = DeviceLink(lambda sequence, order: GripOrder(self.node_id, sequence, *order), GRIP_AGAIN_US)

    def sense(self, state: GripState) -> None:
        """Takes up how the gripper is; the first time also which order it had last."""
        if self.state is None:
            self.link.go_on_from(state.sequence)
        self.state = state

    @property
    def mode(self) -> GripMode:
        """What it said last; OPEN before it has said anything."""
        return self.state.grip_mode if self.state is not None else GripMode.OPEN

    def holds(self, part: Reference) -> bool:
        """Whether this part and no other is in it."""
        return self.state is not None and self.mode is GripMode.HOLDING and self.state.part == part

    @property
    def is_at_work(self) -> bool:
        """Whether it moves, or may begin to at any moment: it has an order that it has not done."""
        return self.mode is GripMode.BUSY or (self.link.wanted is not None and not self._has_failed)

    @property
    def _has_failed(self) -> bool:
        """Whether it has obeyed, and there was nothing to take."""
        obeyed = self.state is not None and self.link.is_obeyed(self.state.sequence)
        return self.mode is GripMode.NOTHING_THERE and obeyed

    def order(self, action: GripAction, part: Reference, now_us: int) -> list[Effect]:
        """Said again while it is not obeyed; a grip at nothing is tried anew."""
        permit = authorised(self.motion, [part_token(part)])
        return self.link.order((action, part), permit, now_us, anew=self._has_failed)
