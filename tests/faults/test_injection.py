"""Faults as text and as data: what is read is what is written, and a mistake is one line with its remedy."""

import pytest

from bus_sim.campaign.profiles import PROFILES, draw_faults
from bus_sim.can.faults import Fault
from bus_sim.faults.arm import ACTIONS, check_targets, frame_faults
from bus_sim.faults.injection import Injection, parse_injection
from bus_sim.faults.table import KINDS, Value
from bus_sim.sites import find_site


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "none"])
def test_what_a_profile_draws_is_read_back_and_fits_the_site(profile: str) -> None:
    site = find_site("small")
    seen = set()
    for seed in range(60):
        faults = draw_faults(profile, seed, site)
        assert faults == draw_faults(profile, seed, site)
        check_targets(faults, site)
        for fault in faults:
            seen.add(fault.kind)
            assert parse_injection(str(fault)) == fault
    assert seen == set(PROFILES[profile])


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
    }
    for name, kind in KINDS.items():
        given = {key: values[key] for key, setting in kind.settings.items() if setting.default is None}
        injection = Injection(name, given)
        assert (name in ACTIONS) is not bool(frame_faults([injection], site))


def test_frame_faults_keep_their_own_settings() -> None:
    assert isinstance(parse_injection("omission:receivers=11,probability=0.5"), Fault)


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
