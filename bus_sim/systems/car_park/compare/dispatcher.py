"""A central dispatcher as one more node of the fleet: it hears every task, decides, and tells the compartment.

The idealised opponent: it reads all robots' programs and mirrors directly, knows how many customers wait before each
compartment, and pays nothing for any of that; only its word goes over the bus.
"""

from bus_sim.systems.car_park.compare.obedience import DISPATCHER, TASKS, ObedientNegotiation
from bus_sim.systems.car_park.compare.policies import Dispatch, DispatchScene, OpenTask, Policy
from bus_sim.systems.car_park.compare.prospect import Prospect
from bus_sim.systems.car_park.plant.customer import CustomerState
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, Grade, MachineState, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, CallForProposals, Itinerary, Message, TaskReport
from onboard.core.negotiation import CallKey
from onboard.systems.car_park.robot import ParkingRobot
from onboard.ways.site import way_site
from onboard.wire.codec import fleet_codec

#: Everybody has read a frame so long after it was heard, us: the time that a controller takes to read it.
SETTLING_US = 2_000
#: Open tasks are looked at again at least this often, us: nothing that waits is overlooked.
TICK_US = 15_000_000
#: Customers in these states wait for their compartment's bay.
WAITING = (CustomerState.QUEUEING, CustomerState.AT_DESK, CustomerState.AWAITING_DOOR)


class Dispatcher:
    """Directs a simulation's robots by a policy. Make it right after the simulation was started."""

    def __init__(self, simulation: Simulation, policy: Policy, robots: dict[int, ObedientNegotiation]) -> None:
        self.orders = 0
        self._simulation = simulation
        self._policy = policy
        self._negotiations = robots
        self._bus = simulation.fleet.attach("dispatcher", DISPATCHER)
        self._open: dict[CallKey, CallForProposals] = {}
        self._ordered: dict[int, CallKey] = {}
        self._decided: list[Dispatch] = []
        self._tries: dict[CallKey, int] = {}
        self._due_us: int | None = None
        simulation.observers.append(self.hear)

    def hear(self, message: Message, time_us: int) -> None:
        """A message of the fleet bus."""
        match message:
            case CallForProposals() if message.operation in TASKS:
                self._open[CallKey(message.sender, message.call)] = message
            case Itinerary(grade=Grade.FIRM):
                key = self._ordered.get(message.sender)
                if key is None or (message.stamp.initiator, message.stamp.call) != (key.initiator, key.call & 0xFF):
                    return
                del self._ordered[message.sender]
            case TaskReport(phase=TaskPhase.DONE):
                pass
            case _:
                return
        self._look_at(time_us + SETTLING_US)

    def _look_at(self, when_us: int) -> None:
        if self._open and (self._due_us is None or when_us < self._due_us):
            self._due_us = when_us
            self._simulation.loop.at_us(when_us, self._look)

    def _look(self, when_us: int) -> None:
        if when_us != self._due_us:
            return
        self._due_us = None
        if self._ordered:
            # One order after the other: each robot is to know the plan that came of the one before.
            self._look_at(when_us + TICK_US)
            return
        if not self._decided:
            scene = self._scene(when_us)
            self._decided = self._policy.choose(scene) if scene.free and scene.tasks else []
            self._refuse_hopeless(scene)
        if self._decided:
            self._order(self._decided.pop(0))
        soon_us = [
            when_us + max(self._free_in_us(node, when_us) - self._policy.ahead_us, SETTLING_US)
            for node in self._robots()
        ]
        later_us = [free_us for free_us in soon_us if free_us > when_us + SETTLING_US]
        self._look_at(min([*later_us, when_us + TICK_US]))

    # --- what the dispatcher sees ------------------------------------------------------------------------------

    def _robots(self) -> dict[int, ParkingRobot]:
        """Robots that can be sent."""
        found = {}
        for node in self._negotiations:
            holon = self._simulation.controllers[node].holon
            robot = holon.behaviour
            ready = holon.halted is None and robot.state not in (MachineState.STARTING, MachineState.STOPPED)
            if isinstance(robot, ParkingRobot) and ready:
                found[node] = robot
        return found

    def _bus_us(self, node: int, loop_us: int) -> int:
        return self._simulation.controllers[node].holon.clock.bus_us(loop_us)

    def _free_in_us(self, node: int, loop_us: int) -> int:
        """How long a robot still has to work, by its plan; 0 or less for one with nothing to do."""
        robot = self._robots()[node]
        ends = [step.end_us for step in robot.program.remaining if step.work is not None]
        return ends[-1] - self._bus_us(node, loop_us) if ends else 0

    def _scene(self, loop_us: int) -> DispatchScene:
        robots = {node: robot for node, robot in self._robots().items() if node not in self._ordered}
        now_us = max((self._bus_us(node, loop_us) for node in robots), default=loop_us)
        planners = {node: robot.generation for node, robot in robots.items()}
        free = tuple(node for node in robots if self._free_in_us(node, loop_us) <= self._policy.ahead_us)
        tasks = tuple(OpenTask(call, self._waiting(call.sender)) for call in self._open.values())
        return DispatchScene(Prospect(planners, now_us, {}), free, tasks)

    def _waiting(self, compartment: int) -> int:
        """Customers whom the task in a compartment's bay keeps waiting: its own, and the queue behind."""
        customers = self._simulation.plant.street.customers
        return sum(
            one.compartment is not None and one.compartment.node_id == compartment and one.state in WAITING
            for one in customers
        )

    # --- what it says ------------------------------------------------------------------------------------------

    def _order(self, order: Dispatch) -> None:
        call = order.call
        key = CallKey(call.sender, call.call)
        del self._open[key]
        self._tries.pop(key, None)
        self._ordered[order.node] = key
        planner = self._robots()[order.node].generation
        self._negotiations[order.node].orders[key] = call, planner.proposal(call, order.solution, [])
        self.orders += 1
        self._say(call, order.node)

    def _refuse_hopeless(self, scene: DispatchScene) -> None:
        """A task for which no robot has a place is refused after as many looks as others call for it."""
        limit = self._simulation.site.timing.max_attempts
        for key, call in list(self._open.items()):
            if not scene.free or any(planner.mirror.free_places() for planner in scene.prospect.planners.values()):
                continue
            self._tries[key] = self._tries.get(key, 0) + 1
            if self._tries[key] > limit and call.to_station not in self._bays():
                del self._open[key], self._tries[key]
                self._say(call, NOBODY)

    def _bays(self) -> set[int]:
        return {station.number for station in way_site(self._simulation.site).compartments.values()}

    def _say(self, call: CallForProposals, winner: int) -> None:
        result = CallResult.AWARDED if winner else CallResult.REFUSED
        award = Award(DISPATCHER, call.call, winner, call.task, 1, result, Reason.NONE)
        for frame in fleet_codec().encode(award):
            self._bus.send(frame)
