"""Moving a drive a little, as its controller would: orders are repeated while it moves, and it is watched."""

from dataclasses import dataclass

from hil.commission.setting import REPEAT_S, CommissionSetting
from onboard.contract.codes import DriveMode
from onboard.contract.messages import DriveOrder, DriveState
from onboard.core.serial import successor

#: A drive counts as arrived this near its target, mm.
ARRIVED_MM = 5
#: A drive that was told to move says so within this, s.
BEGIN_S = 2.0


@dataclass(frozen=True, slots=True)
class Moved:
    """One small journey, mm along the track, and how the drive ended it."""

    from_mm: int
    target_mm: int
    to_mm: int
    mode: DriveMode
    has_moved: bool

    @property
    def has_arrived(self) -> bool:
        """Whether the drive stands where it was told to go."""
        return self.mode is DriveMode.STANDING and abs(self.to_mm - self.target_mm) <= ARRIVED_MM

    def __str__(self) -> str:
        return f"from {self.from_mm} mm to {self.to_mm} mm, ordered to {self.target_mm} mm, {self.mode.name.lower()}"


async def move(setting: CommissionSetting, by_mm: int, speed_mm_s: int, *, orders: int | None = None) -> Moved | None:
    """Drive by so much, at so much; None where the drive does not tell its place.

    ``orders``: give so many only, then none, to see whether it brakes by itself. Returns once it stands again, or is
    in fault, or after half as long again as it should take.
    """
    begin = setting.position() or await setting.devices.first(DriveState, REPEAT_S, setting.is_own)
    if begin is None:
        return None
    target_mm = begin.position_mm + by_mm
    order = DriveOrder(
        setting.machine.node_id, successor(begin.sequence, 8), target_mm, speed_mm_s, across=begin.across
    )
    since = setting.devices.mark()
    refresh_s = setting.site.timing.drive_refresh_us / 1e6
    left = BEGIN_S + 1.5 * abs(by_mm) / speed_mm_s
    given = 0
    while left > 0:
        if orders is None or given < orders:
            setting.devices.say(order)
            given += 1
        if await setting.devices.notice.until(lambda: _ended(setting, since), refresh_s) is not None:
            break
        left -= refresh_s
    now = setting.position() or begin
    return Moved(begin.position_mm, target_mm, now.position_mm, now.mode, _has_moved(setting, since))


def _states(setting: CommissionSetting, since: int) -> list[DriveState]:
    return [one for _, one in setting.devices.heard[since:] if isinstance(one, DriveState) and setting.is_own(one)]


def _has_moved(setting: CommissionSetting, since: int) -> bool:
    return any(one.mode in (DriveMode.MOVING, DriveMode.BRAKING) for one in _states(setting, since))


def _ended(setting: CommissionSetting, since: int) -> DriveState | None:
    states = _states(setting, since)
    if not states:
        return None
    last = states[-1]
    stands = last.mode is DriveMode.STANDING and _has_moved(setting, since)
    return last if stands or last.mode is DriveMode.FAULT else None
