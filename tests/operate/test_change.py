"""change-site as a person sees it: who has which file, who has followed, and what is said on the bus."""

from onboard.contract.change import ChangePhase, SiteNext
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState
from onboard.contract.messages import Heartbeat, Message
from onboard.operate.change import ChangeCommand
from onboard.operate.order import DONE, NOT_CONFIRMED
from onboard.operate.park import Park
from tests.sites import one_floor

SITE = one_floor(robots=2)
NEW, OLD, STATION = SITE.digest, SITE.digest ^ 1, 251
SECOND = 1_000_000
NAMES = [machine.name for machine in SITE.machines.values()]
ADDED = max(SITE.machines)


def beat(node: int, digest: int, state: MachineState = MachineState.IDLE) -> Heartbeat:
    return Heartbeat(node, CONTRACT_VERSION, digest, 0, 1, KindCode.ROBOT, state)


def hears(command: ChangeCommand, message: Message, now_us: int) -> list[str]:
    command.park.feed(message, now_us)
    command.feed(message, now_us)
    return command.news()


def begun() -> ChangeCommand:
    park = Park(SITE)
    for node in SITE.machines:
        if node != ADDED:
            park.feed(beat(node, OLD), SECOND)
    command = ChangeCommand(park, STATION, old=OLD)
    *others, last = command.preview(2 * SECOND)
    assert others == [f"{name} has the old file" for name in NAMES[:-1]] and last == f"{NAMES[-1]} is not heard"
    command.begin(2 * SECOND)
    command.news()
    return command


def test_it_is_announced_every_two_seconds_until_all_take_part_by_the_new_file() -> None:
    command = begun()
    word = SiteNext(STATION, OLD, NEW, ChangePhase.ANNOUNCED)
    assert command.wake(2 * SECOND) == [word] and command.next_wake() == 4 * SECOND
    for node, name in zip(SITE.machines, NAMES, strict=True):
        if node != ADDED:
            heard = SiteNext(node, OLD, NEW, ChangePhase.HEARD)
            assert hears(command, heard, 3 * SECOND) == [f"{name} counts both"]
            assert hears(command, heard, 3 * SECOND) == [], "once"
    assert command.wake(4 * SECOND) == [word]
    for node in SITE.machines:
        assert command.status is None
        assert hears(command, beat(node, NEW, MachineState.STARTING), 5 * SECOND) == [], "it does not take part yet"
        assert hears(command, beat(node, OLD), 5 * SECOND) == []
        (line,) = hears(command, beat(node, NEW), 5 * SECOND)
        assert line.startswith(f"{SITE.machines[node].name} takes part by the new file")
    assert command.next_wake() == 5 * SECOND, "whoever waits for it is to hear at once that it is over"
    assert command.wake(5 * SECOND) == [SiteNext(STATION, OLD, NEW, ChangePhase.OVER)]
    assert command.status == DONE and command.news() == ["all machines take part by the new file"]


def test_whoever_breaks_it_off_is_told_who_has_not_followed() -> None:
    command = begun()
    hears(command, beat(ADDED, NEW), 3 * SECOND)
    assert command.interrupt(4 * SECOND) == []
    left = ", ".join(NAMES[:-1])
    assert command.news() == [f"broken off; not on the new file: {left}; give the command again to go on"]
    assert command.status == NOT_CONFIRMED
