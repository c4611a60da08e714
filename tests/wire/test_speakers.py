"""What kinds may say, by the DBC of each system."""

import pytest

from onboard.contract.codes import KindCode
from onboard.contract.graph import NodeAnswer, VisitList
from onboard.contract.messages import (
    Award,
    Blocked,
    CallForProposals,
    EmergencyStop,
    Go,
    Itinerary,
    OperatorOrder,
    TokenGrant,
)
from onboard.systems.registry import find_system, system_names
from onboard.wire.codec import codecs, fleet_codec
from tests.wire.samples import frames_of

_EVERYBODY = frozenset(KindCode) - {KindCode.ANY}
_GATEWAY = KindCode.OBSERVER
_MACHINES = _EVERYBODY - {_GATEWAY}


def test_the_dbcs_senders_as_kinds() -> None:
    speakers = fleet_codec().speakers
    assert speakers[EmergencyStop] == speakers[CallForProposals] == speakers[Award] == _EVERYBODY
    assert speakers[TokenGrant] == _MACHINES
    assert speakers[Itinerary] == _MACHINES - {KindCode.COMPARTMENT}
    assert speakers[Go] == speakers[OperatorOrder] == {_GATEWAY}
    assert speakers[Blocked] == {KindCode.LIFT, KindCode.COMPARTMENT, _GATEWAY}


def test_what_a_system_adds() -> None:
    speakers = codecs(frames_of("graph")).fleet.speakers
    assert speakers[NodeAnswer] == {KindCode.NODE}
    assert speakers[VisitList] == {KindCode.DESK, _GATEWAY}


@pytest.mark.parametrize("name", system_names())
def test_every_message_of_a_fleet_bus_has_a_kind_of_its_system_or_a_gateway_that_says_it(name: str) -> None:
    system = find_system(name)
    speakers = codecs(frames_of(name)).fleet.speakers
    own = [frame.says for frame in frames_of(name) if frame.says is not None and not frame.is_device]
    assert all(speakers[cls] & ({*system.factories, _GATEWAY}) for cls in own)
