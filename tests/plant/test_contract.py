"""The plant keeps the times that the device contract promises to a controller."""

import cantools.database
import pytest
from cantools.database.can import Database

from bus_sim.systems.car_park.plant import carrier, compartment, lift, shuttle
from dbc import device_dbc_text


@pytest.fixture(scope="module")
def contract() -> Database:
    database = cantools.database.load_string(device_dbc_text(), "dbc")
    assert isinstance(database, Database)
    return database


def test_drive_time_out(contract: Database) -> None:
    attributes = contract.get_message_by_name("DriveOrder").dbc.attributes  # type: ignore[union-attr]  # a DBC has it
    assert attributes["DriveTimeOutMs"].value * 1000 == carrier.DRIVE_TIMEOUT_US


@pytest.mark.parametrize(
    ("message", "repeat_us"),
    [
        ("DriveState", carrier.REPEAT_US),
        ("ShuttleState", shuttle.REPEAT_US),
        ("DoorState", compartment.REPEAT_US),
        ("BayState", compartment.REPEAT_US),
        ("PlatformState", lift.REPEAT_US),
    ],
)
def test_cycle_times(contract: Database, message: str, repeat_us: int) -> None:
    cycle_ms = contract.get_message_by_name(message).cycle_time
    assert cycle_ms is not None
    assert cycle_ms * 1000 == repeat_us
