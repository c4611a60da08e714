"""A robot held by a person, or by whoever orders for one (row M38): where it may stop, and how it comes to rest.

It drives to the end of what it has the right to and stands there, an obstacle that others plan around. What must not be
left half done is ended first: a ride with the way off the platform, a turn in the mouth of a spur, a handling that has
begun. Let go, it plans the same work anew from where it stands.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import DriveMode, LegAction, TaskPhase
from onboard.contract.messages import ManualOrder, Message, Reference, TaskReport
from onboard.core.effects import Effect
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.handling import ShuttleWork
from onboard.systems.car_park.program import HandlingPhase
from onboard.systems.car_park.travel import Carriage
from onboard.ways.mirror import WayFleet
from onboard.work.manual import Manual


@dataclass
class RobotHold:
    """One robot's mode. The order is kept by its journal, so a robot that was held is held after a restart."""

    fleet: WayFleet
    generation: CarParkGeneration
    carriage: Carriage
    shuttle: ShuttleWork
    manual: Manual = field(init=False)

    def __post_init__(self) -> None:
        self.manual = Manual(self.fleet.node_id)
        self.manual.replay(self.fleet.entries)
        self.generation.is_held = self.is_held

    @property
    def is_held(self) -> bool:
        """Whether it begins nothing more."""
        return not self.manual.is_automatic

    @property
    def is_at_rest(self) -> bool:
        """Whether it is held and stands: an obstacle until it is let go."""
        return self.is_held and self.manual.at_rest

    def ordered(self, order: ManualOrder) -> list[Effect]:
        """Held, or let go. Others have planned around a robot that was held: its plans of before are old."""
        was_held = self.is_held
        effects = self.manual.ordered(order)
        self.generation.is_held = self.is_held
        if was_held and not self.is_held:
            self.fleet.admissions += 1
        return effects

    def loses(self, message: Message) -> Reference | None:
        """A task that is given back in another's name while I am held: its car's custodian did not wait for me."""
        if not self.is_held or not isinstance(message, TaskReport) or message.phase is not TaskPhase.FORFEITED:
            return None
        return message.task

    def stops(self, begun: bool) -> bool:
        """Whether nothing more is done for the step in hand, which is ``begun`` or not."""
        if not self.is_held:
            return False
        site, step = self.fleet.site, self.generation.program.step
        if any(slot.track in site.lifts for slot in self.carriage.occupied()):
            return False
        if step is None or not begun or step.action is LegAction.STAND:
            return True
        if step.work is not None:
            return self.shuttle.phase is HandlingPhase.ACQUIRE
        turns = step.from_index == step.to_index or step.track != self.carriage.track
        return step.action is LegAction.TRAVEL and not turns

    def come_to_rest(self, now_us: int) -> list[Effect]:
        """Drive on to where the drive was last sent, which is the end of the rights held, and ask for nothing beyond.

        It says so once it stands.
        """
        carriage = self.carriage
        end = carriage.target or carriage.standing_at
        if end is not None and end != carriage.goal:
            carriage.go(end)
        effects = carriage.advance(now_us)
        stands = carriage.sensed is not None and carriage.sensed.mode is DriveMode.STANDING
        return effects + self.manual.rests(stands and carriage.target is None)
