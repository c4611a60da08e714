"""Commissioning played on a virtual bus: what a good machine's protocol says, and what is said of bad ones."""

import asyncio
from collections.abc import Callable

import pytest

from bus_sim.can.node import SimulatedBus
from bus_sim.options import RunOptions
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from hil.commission.listener import CommissionListener
from hil.commission.person import NoAnswerError
from hil.commission.protocol import Protocol, StepVerdict
from hil.commission.setting import CommissionSetting
from hil.commission.walk import walk
from hil.play import stop_fleet
from onboard.config.site import parse_site
from onboard.contract.codes import CONTRACT_VERSION
from onboard.contract.messages import DriveOrder, Message
from onboard.core.site import Site
from tests.hil.bench_files import BENCHES

SITE = parse_site((BENCHES / "bench.toml").read_text(), "bench.toml")

#: What a person does when a question begins so, beside answering.
Deed = Callable[["Scene"], None]


class Scene:
    """A simulated fleet without the new machine, and a person with ready answers."""

    def __init__(self, name: str, answers: dict[str, str], deeds: dict[str, Deed], site: Site) -> None:
        self.name = name
        self.answers = answers
        self.deeds = deeds
        self.told: list[str] = []
        self.questions: list[str] = []
        self.site = site
        self.simulation: Simulation
        self.spoke: list[SimulatedBus] = []

    def tell(self, text: str) -> None:
        self.told.append(text)

    async def ask(self, question: str) -> str:
        self.questions.append(question)
        for key, deed in self.deeds.items():
            if key in question:
                deed(self)
        for key, answer in self.answers.items():
            if key in question:
                if answer == "GONE":
                    raise NoAnswerError
                return answer
        return "60" if "ohms" in question else "y"

    async def play(self) -> Protocol:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        self.simulation = build(SITE, RunOptions(without=frozenset({self.name, "MR2"})), loop)
        for medium in self.simulation.devices.values():
            medium.attach("another node")
        self.simulation.start()
        machine = next(one for one in SITE.machines.values() if one.name == self.name)
        codecs = self.simulation.codecs
        fleet = self.simulation.fleet.attach("walk")
        devices = self.simulation.devices[machine.node_id].attach("walk")
        self.spoke = [fleet, devices]
        protocol = Protocol(self.name, self.site.name, "2026-01-01 12:00:00+00:00")
        await walk(
            CommissionSetting(
                self.site,
                machine,
                CommissionListener(fleet, codecs.fleet),
                CommissionListener(devices, codecs.device),
                self,
                protocol,
            )
        )
        await stop_fleet(self.simulation)
        return protocol

    def switch_on(self) -> None:
        machine = next(one for one in SITE.machines.values() if one.name == self.name)
        self.simulation.start_controller(machine)

    def node_id(self) -> int:
        return next(one.node_id for one in SITE.machines.values() if one.name == self.name)

    def press_key(self) -> None:
        compartment = self.simulation.plant.compartments[self.node_id()]
        asyncio.get_running_loop().call_later(5, compartment.press_key)

    def press_emergency_stop(self) -> None:
        """The circuit takes the orders away from the drive; it is pressed three seconds after the question."""
        incoming = self.simulation.links[self.node_id()].incoming
        asyncio.get_running_loop().call_later(3, incoming.append, no_orders)

    def release_emergency_stop(self) -> None:
        self.simulation.links[self.node_id()].incoming.remove(no_orders)


def no_orders(message: Message) -> Message | None:
    return None if isinstance(message, DriveOrder) else message


GOOD: dict[str, Deed] = {
    "Switch the controller": Scene.switch_on,
    "PRESS THE EMERGENCY STOP": Scene.press_emergency_stop,
    "Release the emergency stop": Scene.release_emergency_stop,
}


def commission(
    name: str = "MR1",
    answers: dict[str, str] | None = None,
    deeds: dict[str, Deed] | None = None,
    site: Site = SITE,
) -> tuple[Protocol, Scene]:
    scene = Scene(name, answers or {}, {**GOOD, **(deeds or {})}, site)
    loop = VirtualTimeLoop()
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(scene.play()), scene
    finally:
        asyncio.set_event_loop(None)
        loop.close()


def verdicts(protocol: Protocol) -> dict[str, StepVerdict]:
    return {entry.step: entry.verdict for entry in protocol.entries}


def detail(protocol: Protocol, step: str) -> str:
    return next(entry.detail for entry in protocol.entries if entry.step == step)


BUS_STEPS = ["termination", "listening", "node-ID", "digests"]


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        (
            "MR1",
            ["drive's position", "shuttle's sensors", "drive", "shuttle", "drive without orders", "emergency stop"],
        ),
        ("ER1", ["platform's position", "platform's sensors", "drive", "drive without orders", "emergency stop"]),
    ],
)
def test_a_good_machine_passes_every_step(name: str, steps: list[str]) -> None:
    protocol, _ = commission(name, {"name": "A. Person"})
    assert list(verdicts(protocol)) == [*BUS_STEPS, *steps, "joins"]
    assert protocol.is_passed, protocol.text()
    text = protocol.text()
    assert "person      A. Person" in text and "The machine is in order." in text and "signature ____" in text
    assert "60 ohms, wanted 54 to 66" in text and "boot 1, idle" in text


def test_a_compartment_opens_its_doors_one_by_one_and_hears_its_key() -> None:
    def key_soon(scene: Scene) -> None:
        scene.press_key()

    # The key is pressed some seconds after the person has confirmed what the bay says.
    protocol, _ = commission("IOC1", deeds={"The bay's sensors says": key_soon})
    steps = ["doors' sensors", "bay's sensors", "desk key", "doors", "light and desk", "emergency stop"]
    assert list(verdicts(protocol)) == [*BUS_STEPS, *steps, "joins"]
    assert protocol.is_passed, protocol.text()


def test_nothing_is_said_on_either_bus_before_listening_is_over() -> None:
    protocol, scene = commission(answers={"Is that so": "GONE"})
    assert verdicts(protocol)["digests"] is StepVerdict.PASSED
    assert [bus.health().sent for bus in scene.spoke] == [0, 0]
    assert verdicts(protocol)["all further steps"] is StepVerdict.NOT_DONE
    assert "NOT in order" in protocol.text()


@pytest.mark.parametrize(
    ("reading", "said"),
    [("120", "a terminator is missing"), ("40,5", "more than two terminators"), ("0.3", "or a short")],
)
def test_a_wrong_termination_is_recorded_with_its_remedy(reading: str, said: str) -> None:
    protocol, _ = commission(answers={"ohms": reading, "Is that so": "GONE"})
    assert verdicts(protocol)["termination"] is StepVerdict.FAILED
    assert said in detail(protocol, "termination")


def test_a_node_id_that_is_taken_ends_the_walk() -> None:
    protocol, scene = commission(deeds={"Switch the fleet on": Scene.switch_on})
    assert verdicts(protocol)["node-ID"] is StepVerdict.FAILED
    assert "11 is taken" in detail(protocol, "node-ID")
    assert [bus.health().sent for bus in scene.spoke] == [0, 0], "whoever has the node-ID is not spoken over"
    assert list(verdicts(protocol))[-1] == "all further steps"


def test_another_site_file_ends_the_walk_and_names_the_machines() -> None:
    slow = parse_site((BENCHES / "bench.toml").read_text().replace("door_ms = 500", "door_ms = 600"), "bench.toml")
    protocol, _ = commission(site=slow)
    assert verdicts(protocol)["digests"] is StepVerdict.FAILED
    assert f"IOC1 contract {CONTRACT_VERSION}, site {SITE.digest:04X}" in detail(protocol, "digests")
    assert f"here contract {CONTRACT_VERSION}, site {slow.digest:04X}" in detail(protocol, "digests")


def test_an_emergency_stop_that_does_not_stop_the_drive_is_found() -> None:
    nothing: Deed = lambda scene: None  # noqa: E731  a deed like the others
    protocol, _ = commission(deeds={"PRESS THE EMERGENCY STOP": nothing, "Release the emergency stop": nothing})
    assert verdicts(protocol)["emergency stop"] is StepVerdict.FAILED
    assert not protocol.is_passed


def test_a_drive_that_goes_on_without_orders_is_found() -> None:
    def deaf_timeout(scene: Scene) -> None:
        # The same order again and again, from somewhere behind the bus: as if the drive needed no fresh ones.
        link = scene.simulation.links[scene.node_id()]
        carrier = scene.simulation.plant.carriers[scene.node_id()]

        def keep(message: Message) -> Message | None:
            if isinstance(message, DriveOrder):
                loop = asyncio.get_running_loop()
                for tenth in range(1, 40):
                    loop.call_later(tenth / 10, carrier._on_message, message, 0)
                link.incoming.remove(keep)
            return message

        link.incoming.append(keep)

    protocol, _ = commission(deeds={"left without orders": deaf_timeout})
    assert verdicts(protocol)["drive without orders"] is StepVerdict.FAILED


def test_whoever_stands_in_the_way_is_not_driven_at() -> None:
    protocol, scene = commission(answers={"Is nobody in its way": "n", "Are you ready": "n"})
    assert verdicts(protocol)["drive"] is StepVerdict.NOT_DONE
    assert verdicts(protocol)["emergency stop"] is StepVerdict.NOT_DONE
    assert scene.simulation.plant.carriers[11].state(0).position_mm == 4800
    assert "NOT in order: 0 failed, 3 not done" in protocol.text()


def test_what_the_person_denies_fails() -> None:
    protocol, _ = commission(answers={"drive's position says": "n"})
    assert verdicts(protocol)["drive's position"] is StepVerdict.FAILED
    assert "not so" in detail(protocol, "drive's position")


def test_a_controller_that_says_nothing_does_not_pass() -> None:
    protocol, _ = commission(deeds={"Switch the controller": lambda scene: None})
    assert verdicts(protocol)["joins"] is StepVerdict.FAILED
    assert "no heartbeat within 180 s" in detail(protocol, "joins")
