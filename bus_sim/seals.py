"""Seals in a simulation: every node has keys that are drawn from the run's seed, and a life more at each start."""

from collections import Counter
from collections.abc import Callable
from hashlib import blake2s
from itertools import count

from bus_sim.can.medium import Tap
from bus_sim.can.node import SimulatedBus
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Site
from onboard.io.sealed_bus import SealedBus, settings_of
from onboard.ports.bus import Bus
from onboard.seal.gate import Gate
from onboard.seal.keys import KEY_BYTES, Keys
from onboard.seal.listener import SealListener, proving
from onboard.seal.subjects import Reading

#: Nodes of people's tools.
TOOLS = range(MAX_NODE_ID + 1, 256)


class SimulatedSeals:
    """The keys of one run's nodes. Same site, same seed: same keys, same nonces."""

    def __init__(self, site: Site, seed: int, reading: Reading) -> None:
        self._site, self._seed, self._reading = site, seed, reading
        self._lives: Counter[int] = Counter()

    @property
    def are_used(self) -> bool:
        """Whether the site has seals at all."""
        return self._site.seals != "off"

    def keys(self, node: int) -> Keys:
        """What a node of the site, or a tool, has."""
        others = (one for one in (*self._site.machines, *TOOLS) if one != node)
        pairs = {other: self._drawn("pair", min(node, other), max(node, other)) for other in others}
        return Keys(node, self._drawn("group"), pairs)

    def proved(self, tap: Tap) -> Tap:
        """A tap of the fleet bus that is told what counts there: all of it, where no seal is needed."""
        if self._site.seals != "required":
            return tap
        nodes = (*self._site.machines, *TOOLS)
        return proving(SealListener(self._drawn("group"), nodes, self._reading), tap)

    def behind_gate(self, plain: SimulatedBus, node: int) -> Bus:
        """The node's bus as it is to be used: as it is, where the site has no seals."""
        if not self.are_used:
            return plain
        self._lives[node] += 1
        life, number = self._lives[node], count()
        settings = settings_of(self._site, node)

        def nonce() -> int:
            return int.from_bytes(self._drawn("nonce", node, life, next(number))[:6], "big")

        return SealedBus(plain, Gate(self.keys(node), settings, life, nonce, self._reading))

    def _drawn(self, *what: object) -> bytes:
        return blake2s(repr((self._site.name, self._seed, *what)).encode(), digest_size=KEY_BYTES).digest()


def plain_bus(bus: Bus) -> SimulatedBus:
    """A controller's own connection to the simulated bus, behind its seals."""
    plain = bus.plain if isinstance(bus, SealedBus) else bus
    assert isinstance(plain, SimulatedBus)
    return plain


def begin(bus: Bus, then: Callable[[], object]) -> None:
    """Do ``then`` once the bus can be used: at once, where it is not sealed."""
    if isinstance(bus, SealedBus):
        bus.open(then)
    else:
        then()


def cut_off(bus: Bus) -> None:
    """As when a node loses its power."""
    if isinstance(bus, SealedBus):
        bus.be_quiet()
    plain_bus(bus).power_off()
