"""What became of the robots' batteries in a run, as the plant saw it: from power-up on, whatever was shown."""

from dataclasses import dataclass

from bus_sim.systems.car_park.simulation import Simulation


@dataclass(frozen=True)
class BatteryFigures:
    """One robot's battery: charge now and at its lowest, what was drawn, for how long it was charged."""

    name: str
    charge_percent: float
    lowest_percent: float
    drawn_wh: float
    charged_h: float
    is_empty: bool


def battery_figures(run: Simulation) -> tuple[BatteryFigures, ...]:
    """In the order of node-IDs; nothing where robots have no batteries."""
    return tuple(
        BatteryFigures(
            run.site.machines[node].name,
            round(100 * battery.charge_ws / battery.capacity_ws, 1),
            round(100 * battery.lowest_ws / battery.capacity_ws, 1),
            round(battery.drawn_ws / 3600, 1),
            round(battery.charged_us / 3.6e9, 3),
            battery.is_empty,
        )
        for node, battery in sorted(run.plant.batteries.items())
    )


def battery_lines(figures: tuple[BatteryFigures, ...]) -> list[str]:
    """A line for each battery under a head; nothing without batteries."""
    if not figures:
        return []
    return [
        "battery   now lowest    drawn  charged",
        *(
            f"{one.name:<7} {one.charge_percent:>4.0f}% {one.lowest_percent:>5.1f}% {one.drawn_wh:>5.0f} Wh "
            f"{one.charged_h:>6.2f} h{'   EMPTY' if one.is_empty else ''}"
            for one in figures
        ),
    ]
