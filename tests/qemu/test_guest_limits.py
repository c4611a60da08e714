"""A guest that does not come to its end is told, by its own clock."""

from pathlib import Path

import pytest

from hil.guest.machine import GuestError, run_guest
from tests.qemu.guest import require_guest


def test_a_script_has_so_long_in_the_guests_own_time(tmp_path: Path) -> None:
    """An idle guest takes as long as its own clock says, so the limit is a short one."""
    require_guest()
    with pytest.raises(GuestError, match="did not end within 5 s of the guest's time"):
        run_guest("echo it waits\nsleep 10000\n", tmp_path / "share", limit_s=5)
