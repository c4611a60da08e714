"""VDA 5050 in two versions: topics, header and words that differ (schemas 2.1.0 and 3.0.0; tests/mqtt/schemas).

Everything that differs between the versions is in this file, so that the rest builds one message in one way.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from typing import Any

from onboard.contract.battery import BatteryLevel

Json = dict[str, Any]


class Connection(Enum):
    """State of a machine's connection."""

    ONLINE = "online"
    OFFLINE = "offline"
    BROKEN = "broken"


@dataclass(frozen=True, slots=True)
class Dialect:
    """Words of one version. ``renames`` are keys of 2.1 that are named otherwise, wherever they stand."""

    number: str
    topic_root: str
    connection: dict[Connection, str]
    position: str
    position_known: str
    renames: dict[str, str]

    @property
    def is_third(self) -> bool:
        """Whether this is version 3."""
        return self.topic_root == "vda5050/v3"

    def topic(self, manufacturer: str, serial: str, name: str) -> str:
        """The topic of one message: interface name, major version, manufacturer, serial number, message."""
        return f"{self.topic_root}/{manufacturer}/{serial}/{name}"

    def position_of(self, map_id: str, x_m: float, y_m: float, theta: float) -> Json:
        """A position on a map, in metres and radians."""
        return {"x": x_m, "y": y_m, "theta": theta, "mapId": map_id, self.position_known: True}

    def power(self, level: BatteryLevel | None) -> Json:
        """A machine's battery by its last word, percent; the schema wants one of who has none: full, not charging."""
        charge = "stateOfCharge" if self.is_third else "batteryCharge"
        told: Json = {charge: 100, "charging": False}
        if level is not None:
            told = {charge: level.charge_permille / 10, "charging": level.charging}
        return {"powerSupply" if self.is_third else "batteryState": told}

    def safety(self, *, stopped: bool) -> Json:
        """An emergency stop, while it holds the machines: MANUAL, as a person said it and can lift it."""
        key = "activeEmergencyStop" if self.is_third else "eStop"
        return {"safetyState": {key: "MANUAL" if stopped else "NONE", "fieldViolation": False}}

    def operating_mode(self, *, starting: bool, in_service: bool) -> str:
        """AUTOMATIC, or what keeps the machine from taking part."""
        if in_service:
            return "SERVICE"
        return "STARTUP" if starting and self.is_third else "AUTOMATIC"

    def header(self, number: int, wall_us: int, manufacturer: str, serial: str) -> Json:
        """The header of every message; ``number`` counts the messages of one topic, 32 bits."""
        return {
            "headerId": number & 0xFFFFFFFF,
            "timestamp": timestamp(wall_us),
            "version": self.number,
            "manufacturer": manufacturer,
            "serialNumber": serial,
        }

    def renamed(self, value: Any) -> Any:
        """The same message with the keys of this version."""
        if isinstance(value, dict):
            return {self.renames.get(key, key): self.renamed(one) for key, one in value.items()}
        if isinstance(value, list):
            return [self.renamed(one) for one in value]
        return value


DIALECTS: dict[str, Dialect] = {
    "2.1": Dialect(
        "2.1.0",
        "uagv/v2",
        {Connection.ONLINE: "ONLINE", Connection.OFFLINE: "OFFLINE", Connection.BROKEN: "CONNECTIONBROKEN"},
        "agvPosition",
        "positionInitialized",
        {},
    ),
    "3.0": Dialect(
        "3.0.0",
        "vda5050/v3",
        {Connection.ONLINE: "ONLINE", Connection.OFFLINE: "OFFLINE", Connection.BROKEN: "CONNECTION_BROKEN"},
        "mobileRobotPosition",
        "localized",
        {
            "resultDescription": "actionResult",
            "infoDescription": "infoDescriptor",
            "agvKinematic": "mobileRobotKinematics",
            "agvClass": "mobileRobotClass",
            "maxLoadMass": "maximumLoadMass",
            "speedMin": "minimumSpeed",
            "speedMax": "maximumSpeed",
            "accelerationMax": "maximumAcceleration",
            "decelerationMax": "maximumDeceleration",
            "heightMax": "maximumHeight",
            "heightMin": "minimumHeight",
            "maxStringLens": "maximumStringLengths",
            "maxArrayLens": "maximumArrayLengths",
            "msgLen": "maximumMessageLength",
            "idLen": "maximumIdLength",
            "minOrderInterval": "minimumOrderInterval",
            "minStateInterval": "minimumStateInterval",
            "agvActions": "mobileRobotActions",
            "agvGeometry": "mobileRobotGeometry",
            "maxWeight": "maximumWeight",
        },
    ),
}


def timestamp(wall_us: int) -> str:
    """Wall time in us since 1970 as ISO 8601 in UTC with milliseconds (VDA 5050 2.1, section 6.6)."""
    seconds, rest = divmod(wall_us, 1_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest // 1000:03d}Z"
