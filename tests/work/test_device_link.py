"""An order to a device is said until it is obeyed, under one number; another order has another number."""

from collections.abc import Sequence

from bus_sim.sites import find_site
from onboard.contract.codes import Reason
from onboard.contract.graph import RouteAction
from onboard.contract.graph_device import RouteOrder
from onboard.contract.messages import Message
from onboard.core.authority import TokenBook
from onboard.core.effects import Actuate, Effect
from onboard.core.motion_authority import ALONE, MotionAuthority, authorised
from onboard.work.device_link import DeviceLink

AGAIN_US = 500_000
GO, ENTER = (RouteAction.GO, 1, 2), (RouteAction.ENTER, 2, 0)
MAY = MotionAuthority(TokenBook(find_site("graph"), 11))
MAY_NOT = authorised(MAY, ALONE, Reason.EMERGENCY_STOP)
PERMIT = authorised(MAY, ALONE)


def link() -> DeviceLink[tuple[RouteAction, int, int]]:
    made: DeviceLink[tuple[RouteAction, int, int]] = DeviceLink(lambda n, order: RouteOrder(11, n, *order), AGAIN_US)
    made.go_on_from(254)
    return made


def said(effects: Sequence[Effect]) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Actuate)]


def test_it_is_said_again_when_it_is_due_and_not_before() -> None:
    drive, order = link(), RouteOrder(11, 255, *GO)
    assert said(drive.order(GO, PERMIT, 0)) == [order]
    assert drive.order(GO, PERMIT, AGAIN_US - 1) == []
    assert said(drive.order(GO, PERMIT, AGAIN_US)) == [order], "under the same number: the device does it once"
    drive.pause()
    assert said(drive.order(GO, PERMIT, AGAIN_US + 1)) == [order]


def test_another_order_has_another_number_and_0_is_none() -> None:
    drive = link()
    drive.order(GO, PERMIT, 0)
    assert said(drive.order(ENTER, PERMIT, 1)) == [RouteOrder(11, 1, *ENTER)]
    assert (drive.is_obeyed(255), drive.is_obeyed(1)) == (False, True)
    drive.rest()
    assert (drive.due_us, drive.is_obeyed(1)) == (None, False)
    assert said(drive.order(ENTER, PERMIT, 2)) == [RouteOrder(11, 2, *ENTER)], "what is wanted after a rest is new"


def test_an_order_that_failed_is_given_anew() -> None:
    drive = link()
    drive.order(GO, PERMIT, 0)
    assert drive.order(GO, PERMIT, 1, anew=True) == []
    assert said(drive.order(GO, PERMIT, AGAIN_US, anew=True)) == [RouteOrder(11, 1, *GO)]


def test_what_is_not_permitted_is_not_said_and_is_due_again_later() -> None:
    drive = link()
    assert (drive.order(GO, MAY_NOT, 0), drive.wanted) == ([], None)
    drive.order(GO, PERMIT, 0)
    assert drive.order(ENTER, MAY_NOT, AGAIN_US) == []
    assert (drive.wanted, drive.due_us) == (GO, 2 * AGAIN_US)


def test_each_repeat_is_asked_for_anew() -> None:
    why = [Reason.NONE]
    motion = MotionAuthority(TokenBook(find_site("graph"), 11), lambda: why[-1])
    drive = link()
    drive.order(GO, authorised(motion, ALONE), 0)
    why.append(Reason.EMERGENCY_STOP)
    assert drive.again(AGAIN_US) == [] and drive.due_us == 2 * AGAIN_US
    why.append(Reason.NONE)
    assert said(drive.again(2 * AGAIN_US)) == [RouteOrder(11, 255, *GO)]
