"""An order to a device is said until it is obeyed, under one number; another order has another number."""

from onboard.core.effects import Actuate
from onboard.systems.graph.messages import RouteAction, RouteOrder
from onboard.work.device_link import DeviceLink

AGAIN_US = 500_000
GO, ENTER = (RouteAction.GO, 1, 2), (RouteAction.ENTER, 2, 0)


def link() -> DeviceLink[tuple[RouteAction, int, int]]:
    made: DeviceLink[tuple[RouteAction, int, int]] = DeviceLink(lambda n, order: RouteOrder(11, n, *order), AGAIN_US)
    made.go_on_from(254)
    return made


def test_it_is_said_again_when_it_is_due_and_not_before() -> None:
    drive = link()
    said = Actuate(RouteOrder(11, 255, *GO))
    assert drive.order(GO, 0) == [said]
    assert drive.order(GO, AGAIN_US - 1) == []
    assert drive.order(GO, AGAIN_US) == [said], "under the same number: the device does it once"
    drive.pause()
    assert drive.order(GO, AGAIN_US + 1) == [said]


def test_another_order_has_another_number_and_0_is_none() -> None:
    drive = link()
    drive.order(GO, 0)
    assert drive.order(ENTER, 1) == [Actuate(RouteOrder(11, 1, *ENTER))]
    assert (drive.is_obeyed(255), drive.is_obeyed(1)) == (False, True)
    drive.rest()
    assert (drive.due_us, drive.is_obeyed(1)) == (None, False)
    assert drive.order(ENTER, 2) == [Actuate(RouteOrder(11, 2, *ENTER))], "what is wanted after a rest is new"


def test_an_order_that_failed_is_given_anew() -> None:
    drive = link()
    drive.order(GO, 0)
    assert drive.order(GO, 1, anew=True) == []
    assert drive.order(GO, AGAIN_US, anew=True) == [Actuate(RouteOrder(11, 1, *GO))]
