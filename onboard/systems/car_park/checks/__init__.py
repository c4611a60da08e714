"""What a car park's log is judged by."""

from onboard.systems.car_park.checks.bids import TrueBidsGoDown
from onboard.systems.car_park.checks.cars import CarsConserved, OneCustodian
from onboard.systems.car_park.checks.customers import CustomersServed, FullMeansFull, TasksServed
from onboard.systems.car_park.checks.doors import Doors
from onboard.systems.car_park.checks.lifts import LiftByGate, LiftCrush, PlatformThere
from onboard.systems.car_park.checks.liveness import NobodyStarves, NoRounds, SomethingHappens
from onboard.systems.car_park.checks.motion import InsideAuthority, OneBody
from onboard.systems.car_park.checks.shuttles import TornCar
from onboard.trace.check.calls import BidsInTime, CallsClosed
from onboard.trace.check.holds import HoldAnswered, LetGoAgain
from onboard.trace.check.owners import OneOwner
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Rule

#: Every rule, in the order in which the report names them.
RULES: tuple[type[Rule], ...] = (
    OneHolder,
    InsideAuthority,
    OneBody,
    LiftByGate,
    LiftCrush,
    PlatformThere,
    TornCar,
    Doors,
    CarsConserved,
    OneCustodian,
    OneOwner,
    CallsClosed,
    BidsInTime,
    TrueBidsGoDown,
    TasksServed,
    CustomersServed,
    FullMeansFull,
    SomethingHappens,
    NobodyStarves,
    NoRounds,
    LetGoAgain,
    HoldAnswered,
)
