"""``bus-sim run graph``: orders come to the desk, robots and node agents do the rest; what came of it is printed."""

import sys
from statistics import fmean
from typing import TYPE_CHECKING, cast

from bus_sim.certify.certificate import certify
from bus_sim.run import BusRun
from bus_sim.systems.graph.plant import GraphPlant, make_plant
from bus_sim.systems.graph.show import picture
from bus_sim.systems.session import Played, SystemPlant, conclude, play
from onboard.core.messages import Bid, CallForProposals
from onboard.core.site import Site
from onboard.systems.graph.messages import EdgeNotice, NodeAnswer, NodeVerdict, OrderResult, TurnSignal
from onboard.systems.graph.site import FactoryGraph

if TYPE_CHECKING:
    from bus_sim.systems.registry import SystemOptions

#: States searched for the certificate that a run begins with.
CERTIFICATE_STATES = 100_000


def run_graph(site: Site, options: "SystemOptions") -> int:
    """Run a graph to its end, print its certificate, the last picture and the indicators; the exit status."""
    assert isinstance(site, FactoryGraph)
    certificate = certify(site.graph, len(site.robots), site.rules, site.capacity, CERTIFICATE_STATES)
    words = {True: "deadlock-free under these rules", False: "not certified", None: "undecided"}
    if not options.quiet:
        sys.stdout.write(
            f"site {site.name}, seed {options.seed}, {len(site.robots)} robots, rules {site.rules.value}\n"
        )
        sys.stdout.write(f"certificate: {words[certificate.certified]} ({certificate.reason})\n")

    def show(_: BusRun, plant: SystemPlant) -> str:
        return picture(cast("GraphPlant", plant))

    played = play(site, options, make_plant, show)
    if not options.quiet:
        sys.stdout.write("\n" + picture(cast("GraphPlant", played.plant)) + "\n\n")
    return conclude(played, site, options, figures(played), options.quiet)


def figures(played: Played) -> dict[str, object]:
    """What a graph is judged by: orders and their times, and how often robots had to wait or were sent away."""
    plant = cast("GraphPlant", played.plant)
    done = [entry for entry in plant.entries if entry.result is OrderResult.DONE and entry.ended_us is not None]
    seconds = [(entry.ended_us - entry.begun_us) / 1e6 for entry in done if entry.ended_us is not None]
    ends = [entry.ended_us for entry in done if entry.ended_us is not None]
    begins = [entry.begun_us for entry in plant.entries]
    said = [message for _, message in played.messages]
    answers = [one.node_verdict for one in said if isinstance(one, NodeAnswer)]
    return {
        "orders": len(plant.entries),
        "done": len(done),
        "refused": sum(entry.result is OrderResult.REFUSED for entry in plant.entries),
        "mean_time_s": fmean(seconds) if seconds else 0.0,
        "total_time_s": (max(ends) - min(begins)) / 1e6 if ends else 0.0,
        "signals": sum(isinstance(one, TurnSignal) for one in said),
        "go": answers.count(NodeVerdict.GO),
        "stop": answers.count(NodeVerdict.STOP),
        "another_edge": answers.count(NodeVerdict.ANOTHER),
        "notices": sum(isinstance(one, EdgeNotice) for one in said),
        "calls": sum(isinstance(one, CallForProposals) for one in said),
        "bids": sum(isinstance(one, Bid) for one in said),
    }
