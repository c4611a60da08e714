"""Words of a robotized car park: cars by their tickets, compartments by name, places as p(2,7)F."""

from onboard.contract.codes import Operation, TaskPhase
from onboard.contract.messages import Reference
from onboard.systems.car_park.site import class_of_end
from onboard.systems.words import SiteWords
from onboard.ways.site import WaySite


class CarParkWords(SiteWords):
    """What a car park's messages mean."""

    noun = "car"

    def __init__(self, site: WaySite) -> None:
        super().__init__(site)
        self._bays = {station.number: node for node, station in site.compartments.items()}

    def place(self, number: int) -> str:
        """A place, a compartment by its name, ``anywhere``, for a class of car or for all, or ``outside``."""
        if class_of_end(number):
            return f"anywhere for class {class_of_end(number)}"
        return self.machine(self._bays[number]) if number in self._bays else super().place(number)

    def report(self, operation: Operation, phase: TaskPhase, load: Reference, station: int) -> str:
        """A customer's car is parked or fetched, and where."""
        where = self.place(station)
        match phase:
            case TaskPhase.LOADED:
                return f"has loaded the car at {where}"
            case TaskPhase.DONE:
                return f"has {'parked' if operation is Operation.PARK else 'fetched'} the car: {where}"
            case TaskPhase.REFUSED:
                return f"refuses the car at {where}"
            case TaskPhase.FORFEITED:
                return f"gives the task up at {where}"
        return ""


WORDS = CarParkWords
