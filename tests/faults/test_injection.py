"""Faults as text and as data: what is read is what is written, and a mistake is one line with its remedy."""

from dataclasses import replace

import pytest

from bus_sim.campaign.profiles import PROFILES, draw_at_rate, draw_faults, kinds_for
from bus_sim.can.faults import InjectedFault
from bus_sim.faults.arm import actions_for, check_targets
from bus_sim.faults.bus import frame_faults
from bus_sim.faults.injection import Injection, parse_injection
from bus_sim.faults.table import KINDS, Value
from bus_sim.sites import find_site
from bus_sim.systems.car_park.power import OF_BATTERIES
from onboard.systems.car_park.battery import Battery
from onboard.systems.car_park.site import car_park

#: What nothing strikes where robots have none.
BATTERY = Battery(500, 600, 600, 400, 80, 500, 25, 50, 80, ())


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "none"])
def test_what_a_profile_draws_is_read_back_and_fits_the_site(profile: str) -> None:
    plain = find_site("small")
    site = replace(car_park(plain), battery=BATTERY)
    seen = set()
    for seed in range(90):
        faults = draw_faults(profile, seed, site)
        assert faults == draw_faults(profile, seed, site)
        check_targets(faults, site)
        for fault in faults:
            seen.add(fault.kind)
            assert parse_injection(str(fault)) == fault
    assert seen == set(PROFILES[profile])
    assert kinds_for(profile, plain).keys() == seen - OF_BATTERIES


def test_several_profiles_bring_what_each_brings_by_itself() -> None:
    site = find_site("small")
    both = draw_faults("crash,people", 5, site)
    assert sorted(map(str, both)) == sorted(
        str(one) for name in ("crash", "people") for one in draw_faults(name, 5, site)
    )
    assert {fault.kind for seed in range(20) for fault in draw_at_rate("crash,people", seed, site, 6, 36_000)} == {
        *PROFILES["crash"],
        *PROFILES["people"],
    }


def test_at_a_rate_faults_fill_the_whole_run_and_name_cars_that_are_there() -> None:
    site, arrivals_s = find_site("small"), [200.0 * number for number in range(1, 180)]
    faults = [fault for seed in range(8) for fault in draw_at_rate("all", seed, site, 6, 36_000, arrivals_s)]
    assert 8 * 60 * 0.85 < len(faults) < 8 * 60 * 1.15
    times_s = [fault.number("at_s") for fault in faults if "at_s" in fault.given]
    assert min(times_s) < 1_000 and 35_000 < max(times_s) < 36_000
    early = [
        fault.count("car") for fault in draw_at_rate("people", 1, site, 60, 2_000, arrivals_s) if "car" in fault.given
    ]
    assert early and max(early) <= 11
    assert draw_at_rate("none", 1, site, 6, 36_000) == ()
    assert [parse_injection(str(fault)) for fault in faults] == faults


def test_every_kind_of_the_table_does_something() -> None:
    site = find_site("small")
    values: dict[str, Value] = {
        "target": "MR1",
        "members": "MR1",
        "receivers": "MR1",
        "at_s": 1.0,
        "car": 1,
        "track": 1,
        "index": 3,
        "name": "stop",
        "do": "stop",
    }
    for name, kind in KINDS.items():
        given = {key: values[key] for key, setting in kind.settings.items() if setting.default is None}
        injection = Injection(name, given)
        assert (name in actions_for(site)) is not bool(frame_faults([injection], site))


def test_frame_faults_keep_their_own_settings() -> None:
    assert isinstance(parse_injection("omission:receivers=11,probability=0.5"), InjectedFault)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("crush:target=MR1", "fault 'crush': no such kind; did you mean \"crash\"?"),
        ("crash:at_s=5", "fault crash: target is missing; give target=the name of a machine, such as MR1"),
        ("crash:target=MR1,at=5", "'at=5' is no setting of crash; did you mean \"at_s\"?"),
        ("crash:target=MR1,at_s=soon", "at_s=soon: must be seconds from 0 to 1000000"),
        ("crash:target=MR1,at_s=-1", "at_s=-1: must be seconds from 0"),
        ("crash:target=MR1,at_s=1,at_s=2", "at_s is given twice"),
        ("crash:target=MR1,at_s=1,restart=later", "restart=later: must be yes or no"),
        ("babble:at_s=1,rate_hz=0", "rate_hz=0: must be frames a second from 1 to 5000"),
    ],
)
def test_a_mistake_is_told_in_one_line(text: str, told: str) -> None:
    with pytest.raises(ValueError, match="fault") as caught:
        parse_injection(text)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_machine_that_is_not_there_is_told_with_the_nearest_name() -> None:
    with pytest.raises(ValueError, match=r"target=MR9: no such machine on site small; did you mean \"MR"):
        check_targets([parse_injection("crash:target=MR9,at_s=1")], find_site("small"))


@pytest.mark.parametrize(("site", "target", "why"), [("small", "IOC1", "use block, or stop"), ("turning", "L1", "use")])
def test_who_cannot_be_held_is_refused_before_the_run(site: str, target: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"target={target}.*{why}"):
        check_targets([parse_injection(f"held:at_s=20,target={target}")], find_site(site))
