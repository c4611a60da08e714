"""Lanes as a desk's cameras see them: each change is told to all vehicles, and again and again (row M36)."""

from dataclasses import dataclass, field

from onboard.contract.terminal import LaneState
from onboard.contract.terminal_device import LaneSensor
from onboard.core.effects import Effect, Send
from onboard.core.serial import to_bus_ms
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.site import EntityKind

#: A lane that is blocked is told again so often, us (dbc/terminal.dbc).
LANE_REPEAT_US = 5_000_000


@dataclass
class Cameras:
    """What one desk has told of its lanes; ``again_at_us``, when it tells all of it again, None without a lane."""

    node_id: int
    mirror: TerminalMirror
    again_at_us: int | None = None
    _lanes: dict[int, LaneState] = field(default_factory=dict)

    def see(self, sensor: LaneSensor, now_us: int) -> list[Effect]:
        """A change on a lane is told to all robots."""
        known = self._lanes.get(sensor.lane)
        entity = self.mirror.site.entities.get(sensor.lane)
        if entity is None or entity.kind is not EntityKind.LANE or (known is None and not sensor.blocked):
            return []
        if known is not None and known.blocked == sensor.blocked:
            return []
        state = LaneState(self.node_id, sensor.lane, sensor.blocked, to_bus_ms(now_us))
        self._lanes[sensor.lane] = state
        self.mirror.on_lane(state, now_us)
        self.again_at_us = now_us + LANE_REPEAT_US
        return [Send(state)]

    def repeat(self, now_us: int) -> list[Effect]:
        """All lanes once more, where it is time."""
        if self.again_at_us is None or self.again_at_us > now_us:
            return []
        self.again_at_us = now_us + LANE_REPEAT_US
        return self.told()

    def told(self) -> list[Effect]:
        """Each lane as it was seen last."""
        return [Send(state) for state in self._lanes.values()]
