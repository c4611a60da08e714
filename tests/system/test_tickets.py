"""Tickets of a whole run: they are printed and read, and its log tells none."""

from onboard.contract.messages import DeskEvent, TicketPrint, TicketRead
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log
from onboard.wire.codec import codecs
from tests.trace.runs import run_log


def test_no_log_of_a_run_holds_a_code() -> None:
    with Log(str(run_log())) as log:
        said = [one.message for one in Listener(codecs()).messages(log) if not one.is_fleet]
    printed = [one for one in said if isinstance(one, TicketPrint)]
    read = [one for one in said if isinstance(one, TicketRead)]
    assert {one.half for one in printed} == {one.half for one in read} == {0, 1}
    assert {one.code for one in printed} | {one.code for one in read} == {0}
    assert any(isinstance(one, DeskEvent) and one.car.number for one in said), "the car was fetched by it"
