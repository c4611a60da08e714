"""The site file of a turning cell; docs/turning.md describes every key."""

from itertools import pairwise

from onboard.config.fleet import FleetReader
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.core.site import Segment
from onboard.systems.turning.site import (
    At,
    BatchDemand,
    Chuck,
    ContourElement,
    Drawing,
    Lathe,
    LatheOperation,
    Material,
    Tool,
    Turning,
    TurningJob,
    element_fault,
)

_NOWHERE = Segment(0, 0)
_WORKS = {"facing": LatheOperation.FACE, "roughing": LatheOperation.ROUGH, "finishing": LatheOperation.FINISH}


def read(root: TomlTable, common: Common) -> Turning:
    """Lathes with their chucks and tools, desks, materials, drawings, and the orders that a run of the site brings."""
    fleet = FleetReader()
    lathes: dict[int, Lathe] = {}
    for table in root.tables("lathes"):
        _read_lathe(table, fleet, lathes)
    for table in root.tables("desks"):
        fleet.add(table, KindCode.DESK, _NOWHERE)
    materials: dict[int, Material] = {}
    for table in root.tables("materials"):
        _read_material(table, materials)
    drawings: dict[int, Drawing] = {}
    for table in root.tables("drawings"):
        _read_drawing(table, drawings)
    for name, words in (
        *(("lathes", "lathe"), ("desks", "desk")),
        *(("materials", "material"), ("drawings", "drawing")),
    ):
        if not root.values.get(name):
            root.bad(name, None, f"no {words}", f"add at least one [[{name}]] table")
    orders = tuple(_read_order(table, drawings, materials) for table in root.tables("orders"))
    timing = read_timing(root.table("timing"), max(1, len(lathes)), len(fleet.by_node), common.bitrate)
    return Turning(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        machines=dict(sorted(fleet.by_node.items())),
        timing=timing,
        lathes=lathes,
        drawings=drawings,
        materials=materials,
        orders=orders,
    )


def _read_lathe(table: TomlTable, fleet: FleetReader, lathes: dict[int, Lathe]) -> None:
    chucks = tuple(_read_chuck(one) for one in table.tables("chucks"))
    tools = tuple(_read_tool(one) for one in table.tables("tools"))
    for name, found in (("chucks", chucks), ("tools", tools)):
        if not found:
            table.bad(name, None, "missing", f"add at least one [[lathes.{name}]] table")
    if len({tool.number for tool in tools}) < len(tools):
        table.bad("tools", None, "two tools with one number", "give each tool a place of its own in the turret")
    base = Lathe(0, "", 1.0, 1.0, 1.0, 1.0, (), ())
    node_before = len(fleet.by_node)
    fleet.add(table, KindCode.LATHE, _NOWHERE)
    values = {
        "hourly_eur": table.number("hourly_eur", 0.01, 10_000),
        "power_kw": table.number("power_kw", 0.1, 1_000),
        "spindle_max_rpm": table.number("spindle_max_rpm", 10, 100_000),
        "reach_mm": table.number("reach_mm", 1, 10_000),
        "stiffness": table.number("stiffness", 0.5, 20, base.stiffness),
        "rapid_mm_min": table.number("rapid_mm_min", 100, 100_000, base.rapid_mm_min),
        "setup_min": table.number("setup_min", 0, 1_000, base.setup_min),
        "load_min": table.number("load_min", 0, 60, base.load_min),
        "unload_min": table.number("unload_min", 0, 60, base.unload_min),
        "tool_change_min": table.number("tool_change_min", 0, 10, base.tool_change_min),
        "edge_change_min": table.number("edge_change_min", 0, 60, base.edge_change_min),
    }
    tailstock = table.choice("tailstock", ["no", "yes"], "no") == "yes"
    if len(fleet.by_node) > node_before:
        node = table.values["node"]
        lathes[node] = Lathe(node, table.values["name"], chucks=chucks, tools=tools, has_tailstock=tailstock, **values)


def _read_chuck(table: TomlTable) -> Chuck:
    low_mm, high_mm = table.number("min_mm", 1, 2_000), table.number("max_mm", 1, 2_000)
    if low_mm > high_mm and not table.wrong:
        table.bad("min_mm", low_mm, f"above max_mm {high_mm:g}", "make the range the right way round")
    return Chuck(table.text("name"), low_mm, high_mm, table.number("grip_mm", 1, 1_000))


def _read_tool(table: TomlTable) -> Tool:
    works = []
    for number, word in enumerate(table.items("works", 'a list such as ["facing", "roughing"]') or []):
        if isinstance(word, str) and word in _WORKS:
            works.append(_WORKS[word])
        else:
            table.bad("works", word, "unknown word", 'known here: "facing", "roughing", "finishing"', item=number)
    if not works and "works" not in table.wrong:
        table.bad("works", None, "missing", 'write a list such as ["facing", "roughing"]')
    return Tool(
        table.integer("number", 1, 16),
        tuple(works),
        table.number("speed_m_min", 1, 3_000),
        table.number("depth_mm", 0.05, 50),
        table.number("feed_mm", 0.01, 5),
        table.number("nose_mm", 0.05, 10),
        table.number("edge_eur", 0, 10_000),
        table.number("life_min", 0.1, 10_000),
    )


def _read_material(table: TomlTable, materials: dict[int, Material]) -> None:
    number = table.integer("number", 1, 255)
    if number in materials:
        table.bad("number", number, "used twice", "give each material a number of its own")
    materials[number] = Material(
        number,
        table.text("name"),
        table.number("cutting_force_n_mm2", 100, 10_000),
        table.number("eur_kg", 0, 10_000),
        table.number("density_kg_dm3", 0.1, 30),
        table.number("speed_factor", 0.01, 100, 1.0),
    )


def _read_drawing(table: TomlTable, drawings: dict[int, Drawing]) -> None:
    """Points of the contour as ``[depth, diameter]`` or ``[depth, diameter, arc radius]``, mm, a convex arc above 0."""
    number = table.integer("number", 1, 255)
    if number in drawings:
        table.bad("number", number, "used twice", "give each drawing a number of its own")
    words = "write points [depth, diameter] or [depth, diameter, arc radius] in mm, the first at depth 0"
    points = table.items("contour_mm", words)
    name, roughness_um = table.text("name"), table.number("roughness_um", 0.05, 100, 3.2)
    if points is None or len(points) < 2 or not all(_is_point(one) for one in points) or points[0][0] != 0:
        table.bad("contour_mm", points, "no contour", words)
        return
    ats = [At(1000.0 * one[0], 500.0 * one[1]) for one in points]
    radii = [1000.0 * one[2] if len(one) > 2 else 0.0 for one in points[1:]]
    elements = [ContourElement(*ends, radius) for ends, radius in zip(pairwise(ats), radii, strict=True)]
    for place, element in enumerate(elements, 1):
        fault = element_fault(element)
        if fault is not None:
            table.bad("contour_mm", points[place], fault[0], fault[1], item=place)
            return
    drawings[number] = Drawing(number, name, tuple(elements), roughness_um)


def _is_point(value: object) -> bool:
    """Two or three numbers of a size that a lathe can turn."""
    if not isinstance(value, list) or len(value) not in (2, 3):
        return False
    return all(type(one) in (int, float) and abs(one) <= 5_000 for one in value) and min(value[:2]) >= 0


def _read_order(table: TomlTable, drawings: dict[int, Drawing], materials: dict[int, Material]) -> BatchDemand:
    drawing, material = table.integer("drawing", 1, 255), table.integer("material", 1, 255)
    for name, value, known in (("drawing", drawing, drawings), ("material", material, materials)):
        if value not in known and name not in table.wrong:
            numbers = ", ".join(str(one) for one in known)
            table.bad(name, value, f"no {name} of this number", f"known here: {numbers}")
    bar_mm, batch = table.integer("bar_mm", 1, 2_000), table.integer("batch", 1, 4_000, 1)
    face_um = table.integer("face_um", 0, 25_500, 1_000)
    if face_um % 100:
        table.bad("face_um", face_um, "not in steps of 100 um", "round it")
    if drawing in drawings and bar_mm < drawings[drawing].diameter_mm and "bar_mm" not in table.wrong:
        table.bad("bar_mm", bar_mm, "thinner than the drawing", f"write {drawings[drawing].diameter_mm:g} or more")
    job = TurningJob(drawing, material, bar_mm, batch, face_um / 1000)
    return BatchDemand(table.integer("at_s", 0, 86_400, 0) * 1000, job)
