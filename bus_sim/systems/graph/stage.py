"""A factory graph's run: orders come to the desk, robots and node agents do the rest; what came of it."""

from statistics import fmean
from typing import TYPE_CHECKING

from bus_sim.systems.graph.certify.certificate import certify
from bus_sim.systems.graph.orders import count
from bus_sim.systems.graph.plant import GraphPlant
from bus_sim.systems.graph.show import picture
from bus_sim.systems.stage import SystemStage, Tally
from onboard.contract.codes import OrderResult
from onboard.contract.graph import EdgeNotice, NodeAnswer, NodeVerdict, TurnSignal
from onboard.contract.messages import Bid, CallForProposals
from onboard.systems.graph.site import FactoryGraph

if TYPE_CHECKING:  # the page's libraries are an extra
    from bus_sim.web.run_source import RunSource

#: States searched for the certificate that a run begins with.
CERTIFICATE_STATES = 100_000


class GraphStage(SystemStage[GraphPlant]):
    """One run of a graph: its robots on nodes and edges, and the visits that are left."""

    def head(self) -> list[str]:
        """With the certificate of its graph under its rules."""
        if self.run.options.quiet:
            return []
        site = self.plant.site
        certificate = certify(site.graph, len(site.robots), site.rules, site.capacity, CERTIFICATE_STATES)
        words = {True: "deadlock-free under these rules", False: "not certified", None: "undecided"}
        return [
            f"{super().head()[0]}, {len(site.robots)} robots, rules {site.rules.value}",
            f"certificate: {words[certificate.certified]} ({certificate.reason})",
        ]

    def tally(self) -> Tally:
        """What became of each order of visits: done, refused, or open still."""
        return count(self.plant)

    def bring(self, site: FactoryGraph, node: int) -> None:
        """The first order of the site that names no robot, once more."""
        anybody = next(order for order in site.orders if not order.robot)
        next(iter(self.plant.counters.values())).add(anybody)

    def picture(self) -> str:
        """Nodes with whoever stands there or is on the way, in characters."""
        return picture(self.plant)

    def source(self) -> "RunSource":
        """The run as the page shows it; a person may order any visits of the site once more."""
        from bus_sim.web.orders import let_order  # noqa: PLC0415  # its libraries are an extra

        return let_order(super().source(), self.plant.counters, self.plant.site.orders)

    def figures(self) -> dict[str, object]:
        """What a graph is judged by: orders and their times, and how often robots had to wait or were sent away."""
        plant = self.plant
        done = [entry for entry in plant.entries if entry.result is OrderResult.DONE and entry.ended_us is not None]
        seconds = [(entry.ended_us - entry.begun_us) / 1e6 for entry in done if entry.ended_us is not None]
        ends = [entry.ended_us for entry in done if entry.ended_us is not None]
        begins = [entry.begun_us for entry in plant.entries]
        said = [message for _, message in self.messages]
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
