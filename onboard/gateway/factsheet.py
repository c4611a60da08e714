"""The message `factsheet` of one mobile machine (VDA 5050 2.1, section 7): what its site file tells of its kind.

A site file names no width and no height of a carrier: they are told as 0, which no vehicle has. A system that names
no masses or speeds tells them as 0 as well.
"""

from onboard.core.site import Machine, Site
from onboard.gateway.dialect import Dialect, Json
from onboard.gateway.edge import edge_of
from onboard.gateway.settings import GatewaySettings

#: Largest payload taken, bytes; see onboard/gateway/inbox.
MOST_BYTES = 65_536
#: Longest identifier, characters, and most instant actions in one message.
MOST_ID, MOST_ACTIONS = 64, 8


def factsheet(dialect: Dialect, site: Site, machine: Machine, settings: GatewaySettings) -> Json:
    """The body of a `factsheet` message, in the keys of the version."""
    edge = edge_of(site)
    body, takes_orders = edge.body(), edge.takes_visits
    actions = _actions(dialect, site, takes_orders=takes_orders)
    kinematic, navigation = (
        ("DIFFERENTIAL", "VIRTUAL_LINE_GUIDED") if dialect.is_third else ("DIFF", "VIRTUAL_LINE_GUIDED")
    )
    content: Json = {
        "typeSpecification": {
            "seriesName": f"{site.system}-{machine.kind.name.lower()}",
            "seriesDescription": f"{machine.kind.name.lower()} of a {site.called}, controlled by its own holon",
            "agvKinematic": kinematic,
            "agvClass": "CARRIER",
            "maxLoadMass": body.load,
            "localizationTypes": ["SPOT"],
            "navigationTypes": [navigation],
        },
        "physicalParameters": {
            "speedMin": 0.0,
            "speedMax": body.speed,
            "accelerationMax": body.acceleration,
            "decelerationMax": body.acceleration,
            "heightMin": 0.0,
            "heightMax": 0.0,
            "width": 0.0,
            "length": body.length,
        },
        "protocolLimits": {
            "maxStringLens": {"msgLen": MOST_BYTES, "idLen": MOST_ID},
            "maxArrayLens": {"instantActions": MOST_ACTIONS} | ({} if takes_orders else {"order.nodes": 0}),
            "timing": {
                "minOrderInterval": 1.0,
                "minStateInterval": settings.least_state_us / 1e6,
                "defaultStateInterval": settings.state_us / 1e6,
                "visualizationInterval": settings.visualization_us / 1e6,
            },
        },
        "protocolFeatures": {"optionalParameters": [], "agvActions": actions},
        "agvGeometry": {},
        "loadSpecification": edge.loads(),
    }
    renamed: Json = dialect.renamed(content)
    return renamed


def _actions(dialect: Dialect, site: Site, *, takes_orders: bool) -> list[Json]:
    """Instant actions that are carried out, and what machines do by themselves."""
    found = [_action(dialect, "stateRequest", "a state is told at once")]
    found.append(_action(dialect, "factsheetRequest", "the factsheet is told again"))
    if not site.no_hold:
        found.append(_action(dialect, "startPause", "held: comes to rest where its rights end, and stands"))
        found.append(_action(dialect, "stopPause", "goes on with the same task"))
    if takes_orders:
        found.append(_action(dialect, "cancelOrder", "ends its edge and does nothing more for the order"))
    return found


def _action(dialect: Dialect, kind: str, description: str) -> Json:
    extra: Json = {"pauseAllowed": False, "cancelAllowed": False} if dialect.is_third else {}
    return {"actionType": kind, "actionDescription": description, "actionScopes": ["INSTANT"], **extra}
