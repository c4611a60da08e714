"""A compartment whose sensors fall silent while a robot has its bay goes by what all know of the car."""

from pathlib import Path

from bus_sim.systems.car_park.demand import Arrivals
from onboard.contract.messages import Award, CallForProposals, Reference
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.system.scenarios import played

PARKED = Reference(1, 1)


def test_a_car_that_was_parked_is_not_called_for_in_the_bay_that_seems_full(tmp_path: Path) -> None:
    """Found by a campaign (small, all faults, 30150): its robot came again, and gripped where no car was."""
    log = tmp_path / "run.log"
    off = "sensor_off:at_s=125.182756,target=IOC1"
    report = played("small", 30150, Arrivals(6, 120, 60, 200), off, limit_s=240, trace=log)
    assert (report.violations, report.stalls, report.error) == ((), (), "")
    decoder = Decoder(fleet_codec())
    with log.open("rb") as lines:
        said = [decoder.feed(one.frame, one.time_us) for one in CandumpReader(lines)]
    about = [one for one in said if isinstance(one, CallForProposals | Award) and one.task == PARKED]
    assert [type(one) for one in about] == [CallForProposals, Award], "called once, and its award said once"
