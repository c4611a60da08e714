"""The turning cell in a terminal: a line a lathe, a line a tool, a line an order."""

from bus_sim.systems.turning.plant import TurningPlant

_BAR = 20


def board(plant: TurningPlant) -> str:
    """Lathes with what they do and how worn their edges are, then the orders."""
    lines = []
    for device in plant.devices.values():
        lathe = device.lathe
        lines.append(
            f"{lathe.name:<8} {device.mode.name.lower():<8} program {device.program:>3}  parts {device.parts:>3}"
        )
        for tool in lathe.tools:
            share = min(1.0, device.used_min[tool.number] / tool.life_min)
            worn = round(share * _BAR)
            lines.append(f"   T{tool.number:02d} [{'#' * worn}{'.' * (_BAR - worn)}] {share:4.0%} worn")
    lines.append("")
    for entry in plant.entries:
        job = entry.wanted.job
        drawing = plant.site.drawings[job.drawing].name
        word = entry.result.name if entry.result is not None else "at the desk"
        name = plant.site.machines[entry.winner].name if entry.winner else "-"
        price = f"{entry.total_ct / 100:.2f} EUR a part" if entry.total_ct else ""
        lines.append(f"order {entry.number}: {job.batch} x {drawing}: {word} {name} {price}".rstrip())
    lines.append(f"{plant.timers.now_us() / 1e6:8.1f} s")
    return "\n".join(lines)
