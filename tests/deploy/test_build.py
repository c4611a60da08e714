"""What people put on boards: the single file, the Debian package, the machine files of a fleet."""

import asyncio
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import onboard
from bus_sim.can.medium import Medium
from bus_sim.serve.socketcand import SocketcandServer
from bus_sim.sites import find_site
from bus_sim.virtual_time import LoopClock
from deploy.archive import build_archive
from deploy.cli import main as deploy
from deploy.package import build_package
from deploy.wheels import PINS, DeployError, pinned_wheels
from onboard.cli import main as onboard_main
from onboard.config.machine import load_machine
from onboard.contract.codes import Reason
from onboard.contract.messages import EmergencyStop, Halted, Heartbeat, Message
from onboard.core.frame import Frame
from onboard.io.endings import ExitStatus
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.tools import DEADLINE_S, require_tool, run_tool

ROOT = Path(__file__).parents[2]
SITE = ROOT / "bus_sim" / "sites" / "small.toml"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The single file; without a package index and a filled store there is none to be had."""
    try:
        pinned_wheels()
    except DeployError as error:
        pytest.skip(str(error))
    return build_archive(tmp_path_factory.mktemp("archive") / "onboard.pyz")


@pytest.fixture(scope="module")
def package(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Debian package; it holds a single file that is made anew."""
    return build_package(tmp_path_factory.mktemp("package") / "onboard.deb")


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Python without any library installed beside it."""
    command = [sys.executable, "-I", "-S", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)


def fleet(to: Path, *words: str) -> Path:
    assert deploy(["machines", str(SITE), "--out", str(to), *words]) == 0
    return to


def test_the_single_file_needs_nothing_beside_it(archive: Path, tmp_path: Path) -> None:
    machine = fleet(tmp_path) / "MR1" / "machine.toml"
    assert run(archive, "--version").stdout == f"onboard {onboard.__version__}\n"
    checked = run(archive, "--machine", machine, "--check")
    assert "MR1 of site small" in checked.stdout, checked.stderr
    assert run(archive, "trace", "--help").returncode == 0


def test_the_single_file_walks_a_person_through_a_new_machine(archive: Path) -> None:
    code = f"import sys; sys.path.insert(0, {str(archive)!r}); from hil.cli import main; main(['commission', '--help'])"
    assert "Walk through a new machine on a live bus" in run("-c", code).stdout


async def test_p58_the_single_file_runs_a_controller_to_its_heartbeat(archive: Path, tmp_path: Path) -> None:
    """Against a served bus, as a board would join it; an emergency stop holds it, and it says so."""
    machine = fleet(tmp_path, "--device", "can0") / "MR1" / "machine.toml"
    heard: asyncio.Queue[Message] = asyncio.Queue()
    decoder = Decoder(fleet_codec())

    def on_frame(frame: Frame, time_us: int) -> None:
        message = decoder.feed(frame, time_us)
        if message is not None:
            heard.put_nowait(message)

    async def scenario() -> tuple[Message, Halted]:
        medium = Medium(LoopClock(asyncio.get_running_loop()))
        server = SocketcandServer(lambda _, name: medium.attach(name), int, port=0)
        port = await server.start()
        ears = medium.attach("ears", 251)
        ears.subscribe(on_frame)
        served = f'interface = "socketcand-asyncio"\nhost = "127.0.0.1"\nport = {port}\n'
        machine.write_text(machine.read_text().replace('interface = "socketcan"\n', served))
        program = await asyncio.create_subprocess_exec(
            *(sys.executable, "-I", "-S", str(archive), "--machine", str(machine)),
            stderr=asyncio.subprocess.PIPE,
        )
        message = await heard.get()
        for frame in fleet_codec().encode(EmergencyStop(251, Reason.OPERATOR)):
            ears.send(frame)
        while not isinstance(held := await heard.get(), Halted):
            pass
        program.terminate()
        _, said = await program.communicate()
        await server.close()
        assert program.returncode == ExitStatus.STOPPED, said.decode()
        return message, held

    async with asyncio.timeout(DEADLINE_S):
        message, held = await scenario()
    assert isinstance(message, Heartbeat) and message.sender == 11
    assert (held.sender, held.reason, held.cause) == (11, Reason.EMERGENCY_STOP, 251)


def test_the_same_sources_give_the_same_bytes(package: Path, tmp_path: Path) -> None:
    """Of the package; that the single file made anew in it is the same, the test of what dpkg unpacks says."""
    assert build_package(tmp_path / "again.deb").read_bytes() == package.read_bytes()


def test_no_compiled_part_ties_the_file_to_a_processor(archive: Path) -> None:
    with zipfile.ZipFile(archive) as inside:
        names = inside.namelist()
    assert not [name for name in names if name.endswith(".so")]
    assert {"onboard/cli.py", "dbc/fleet.dbc", "can/__init__.py", "cantools/__init__.py", "THIRD_PARTY.md"} <= set(
        names
    )


def test_a_wheel_of_another_digest_is_refused(archive: Path, tmp_path: Path) -> None:
    pins = tmp_path / "wheels.txt"
    pins.write_text(PINS.read_text().replace("sha256:1680", "sha256:1681"))
    with pytest.raises(DeployError, match=r"wheels\.txt: "):
        pinned_wheels(pins, tmp_path / "store")


def test_the_package_is_one_that_dpkg_unpacks_and_its_service_is_in_order(
    archive: Path, package: Path, tmp_path: Path
) -> None:
    deb = str(package)
    assert run_tool(require_tool("dpkg-deb"), "--field", deb, "Package", "Version").splitlines() == [
        "Package: onboard-fleet",
        f"Version: {onboard.__version__}",
    ]
    root = tmp_path / "root"
    run_tool("dpkg-deb", "--extract", deb, str(root))
    assert (root / "usr/lib/onboard/onboard.pyz").read_bytes() == archive.read_bytes()
    assert (root / "usr/bin/onboard").stat().st_mode & 0o777 == 0o755
    service = (root / "usr/lib/systemd/system/onboard.service").read_text()
    for line in ("Restart=on-failure", "WatchdogSec=10", "Type=notify", "StartLimitIntervalSec=0"):
        assert line in service.splitlines()
    # The statuses of the program that a person must judge.
    stays = f"RestartPreventExitStatus={ExitStatus.MISTAKE:d} {ExitStatus.WAITS_FOR_PERSON:d}"
    assert stays in service.splitlines()
    assert "/var/lib/onboard/journal.ended" in service


def test_every_machine_of_a_site_gets_its_files(tmp_path: Path) -> None:
    site = find_site("small")
    folders = sorted(fleet(tmp_path, "--fleet", "can0", "--device", "can1").iterdir())
    assert [folder.name for folder in folders] == sorted(machine.name for machine in site.machines.values())
    for folder in folders:
        config = load_machine(folder / "machine.toml")
        assert config.machine.name == folder.name
        assert config.site.digest == site.digest
        assert (config.fleet_bus.channel, config.device_bus.channel) == ("can0", "can1")


def test_one_interface_may_carry_both_buses(tmp_path: Path) -> None:
    config = load_machine(fleet(tmp_path, "--device", "can0") / "ER1" / "machine.toml")
    assert config.device_bus == config.fleet_bus


def test_networkd_is_told_the_sites_bit_rate(tmp_path: Path) -> None:
    site = tmp_path / "slow.toml"
    site.write_text(SITE.read_text().replace("bitrate = 500_000", "bitrate = 125_000"))
    assert deploy(["machines", str(site), "--out", str(tmp_path / "fleet")]) == 0
    machine, to = tmp_path / "fleet" / "MR1" / "machine.toml", tmp_path / "network"
    assert onboard_main(["--machine", str(machine), "--networkd", str(to)]) == 0
    assert {file.name: file.read_text() for file in to.iterdir()} == {
        f"80-onboard-{name}.network": f"[Match]\nName={name}\n\n[CAN]\nBitRate=125000\nRestartSec=100ms\n"
        for name in ("can0", "can1")
    }


def test_a_site_that_is_wrong_is_told_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert deploy(["machines", str(tmp_path / "no.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "no.toml" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("out", ["", "/", "."])
def test_a_path_that_names_no_file_is_one_line(out: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        deploy(["deb", f"--out={out}"])
    assert ended.value.code == 2
    assert f'"{out}": names no file' in capsys.readouterr().err.splitlines()[-1]
