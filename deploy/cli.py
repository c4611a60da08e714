"""``python -m deploy``: what people put on boards."""

import argparse
import os
import sys
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

import onboard
from deploy.archive import build_archive
from deploy.audit import audited
from deploy.fleet import write_fleet
from deploy.image.image import build_image, build_update
from deploy.image.release import Release
from deploy.image.root import build_root
from deploy.locks import write_locks
from deploy.package import build_package
from deploy.replace import write_replacement
from deploy.sbom import write_bill
from deploy.update.bundle import LIFE
from deploy.update.manifest import UpdateError, today, version_key
from deploy.update.signature import make_keys, public_keys
from deploy.wheels import DeployError
from onboard.bounded_file import read_bounded
from onboard.config.arguments import Parser
from onboard.config.problems import ConfigError

#: Outside of any checkout, and nobody else's.
SECRET = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "onboard" / "update-key.pem"
#: Whoever wants updates that count for longer wants none that expire.
MOST_DAYS = 1_000
#: A public key as PEM has 113 bytes.
_MOST_KEY = 10_000
HELP = """\
exit status:
  0  done; each file written is one line
  1  audit: a library has a known weakness; one line for each says which, and where it is mended
  2  a mistake, or something that is missing; one line says what to do

examples:
  python -m deploy archive                 dist/onboard.pyz, which any Python 3.11 or newer runs
  python -m deploy deb                     a Debian package with the service
  sudo python -m deploy root               the root file system for 64-bit ARM boards, its kernel and its digest
  python -m deploy keys                    ~/.config/onboard/update-key.pem, which signs updates and stays there, and
                                           update-key.pub.pem beside it
  sudo python -m deploy image --key ~/.config/onboard/update-key.pub.pem
                                           dist/onboard.img, which boards are flashed with
  sudo python -m deploy update --secret ~/.config/onboard/update-key.pem --version 0.2.0
                                           a signed update for boards that were flashed with such an image
  python -m deploy sbom                    dist/onboard.cdx.json, what all of it is made of
  make audit                               whether any of that has a known weakness; fails where nobody could tell
  python -m deploy machines mysite.toml    dist/machines/NAME/, the files for every board's boot partition
"""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``python -m deploy``."""
    parser: argparse.ArgumentParser = Parser(
        prog="python -m deploy",
        description="Build what is put on boards (deploy/README.md).",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    archive = commands.add_parser("archive", help="the program and its libraries in one file")
    archive.add_argument("--out", type=_file, default=Path("dist/onboard.pyz"), metavar="FILE")
    deb = commands.add_parser("deb", help="a Debian package of it, with the systemd service")
    name = f"dist/onboard-fleet_{onboard.__version__}_all.deb"
    deb.add_argument("--out", type=_file, default=Path(name), metavar="FILE")
    root = commands.add_parser("root", help="kernel and read-only root file system for 64-bit ARM boards")
    root.add_argument("--out", type=Path, default=Path("dist/root"), metavar="DIR")
    _add_image(commands)
    machines = commands.add_parser("machines", help="the machine files of a whole fleet")
    machines.add_argument("site", type=Path, help="site file (docs/site-file.md), or a shipped site's name")
    machines.add_argument("--out", type=Path, default=Path("dist/machines"), metavar="DIR")
    machines.add_argument("--fleet", default="can0", metavar="CHANNEL", help="interface of the fleet bus (can0)")
    machines.add_argument(
        "--device", default="can1", metavar="CHANNEL", help="of the device bus; may be the same (can1)"
    )
    replace = commands.add_parser("replace", help="what a board needs that takes another's place")
    replace.add_argument(
        "--card", type=Path, required=True, metavar="DIR", help="the old board's boot partition, or dist/machines/NAME"
    )
    replace.add_argument("--journal", type=Path, metavar="DIR", help="its journal's folder, where it can be read")
    replace.add_argument("--out", type=Path, default=Path("dist/replace"), metavar="DIR")
    commands.add_parser(
        "lock", help="deploy/locks anew: versions and digests of what each extra installs, as pip chooses"
    )
    bill = commands.add_parser("sbom", help="what boards and extras are made of, as CycloneDX (JSON)")
    bill.add_argument("--out", type=_file, default=Path("dist/onboard.cdx.json"), metavar="FILE")
    audit = commands.add_parser("audit", help="whether any pinned library has a known weakness, by pip-audit")
    audit.add_argument("--tool", default="pip-audit", metavar="PROGRAM", help="where it is installed (pip-audit)")
    return parser


def _days(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= MOST_DAYS:
        raise argparse.ArgumentTypeError(f"{text}: write a number of days from 1 to {MOST_DAYS}")
    return int(text)


def _file(text: str) -> Path:
    if not Path(text).name:
        raise argparse.ArgumentTypeError(f'"{text}": names no file')
    return Path(text)


def _existing(text: str) -> Path:
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"{text}: no such file")
    return Path(text)


def _add_image(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    image = commands.add_parser("image", help="the image that 64-bit ARM boards are flashed with")
    image.add_argument("--out", type=_file, default=Path("dist/onboard.img"), metavar="FILE")
    image.add_argument(
        "--key",
        type=_existing,
        action="append",
        default=[],
        metavar="PEM",
        help="public key of its updates; repeat it for a second key, kept elsewhere; without one it takes none",
    )
    image.add_argument(
        "--pi-firmware",
        type=_existing,
        metavar="DEB",
        help="Debian's package raspi-firmware, not free software; a Raspberry Pi does not start without it",
    )
    keys = commands.add_parser("keys", help="a pair of keys for updates")
    keys.add_argument("--out", type=_file, default=SECRET, metavar="FILE", help=f"the secret one ({SECRET})")
    update = commands.add_parser("update", help="a signed update for boards with such an image")
    update.add_argument("--out", type=_file, metavar="FILE", help="dist/onboard-VERSION.update")
    update.add_argument(
        "--secret", type=_existing, required=True, metavar="PEM", help="the secret key (python -m deploy keys)"
    )
    update.add_argument(
        "--key",
        type=_existing,
        action="append",
        default=[],
        metavar="PEM",
        help="public key that boards trust after it (repeatable; default: that of --secret); all others are revoked",
    )
    update.add_argument(
        "--days", type=_days, default=LIFE.days, metavar="N", help=f"boards take it so long ({LIFE.days})"
    )
    update.add_argument("--site", default="", metavar="NAME", help="only machines of this site take it")
    for parser in (image, update):
        parser.add_argument(
            "--version", default=onboard.__version__, help=f"of the whole system ({onboard.__version__})"
        )


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    args = build_parser().parse_args(argv)
    try:
        if args.command == "audit":
            return _audit(args.tool)
        for path in _build(args):
            print(path)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    except (DeployError, UpdateError) as error:
        print(f"deploy: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"deploy: {error.filename}: {error.strerror}; name another place with --out", file=sys.stderr)
        return 2
    return 0


def _build(args: argparse.Namespace) -> list[Path | str]:
    match args.command:
        case "root":
            made = build_root(args.out, Release())
            return [made.kernel, made.initrd, made.squashfs, f"sha256 {made.digest}"]
        case "machines":
            return [*write_fleet(args.site, args.out, args.fleet, args.device)]
        case "replace":
            return [*write_replacement(args.card, args.journal, args.out)]
        case "image":
            args.out.parent.mkdir(parents=True, exist_ok=True)
            version_key(args.version)
            release = Release(args.version, _keys(args.key))
            image = build_image(args.out, release, pi_firmware=args.pi_firmware)
            return [image.disk, f"sha256 {image.digest}", f"root file system: sha256 {image.root.digest}"]
        case "keys":
            public = args.out.with_suffix(".pub.pem")
            args.out.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            make_keys(args.out, public)
            return [args.out, public]
        case "lock" | "sbom":
            return [*write_locks()] if args.command == "lock" else [write_bill(args.out, onboard.__version__)]
        case "update":
            release, expires = Release(args.version, _keys(args.key)), today() + timedelta(days=args.days)
            return [build_update(args.out, args.secret, release, args.site, expires)]
        case command:
            args.out.parent.mkdir(parents=True, exist_ok=True)
            return [build_archive(args.out) if command == "archive" else build_package(args.out)]


def _audit(tool: str) -> int:
    looked_at, weak = audited(tool)
    for one in weak:
        print(one)
    told = {0: "none has", 1: "1 of the libraries has"}.get(len(weak), f"{len(weak)} of the libraries have")
    print(f"{looked_at} pins were looked at, {told} a known weakness")
    return 1 if weak else 0


def _keys(files: Sequence[Path]) -> bytes:
    return b"".join(map(_key, files))


def _key(file: Path) -> bytes:
    try:
        found = read_bounded(file, _MOST_KEY)
        if public_keys(found) != [found]:
            raise DeployError(f"--key {file}: is no public key; name the .pub.pem that python -m deploy keys wrote")
        return found
    except OSError as error:
        raise DeployError(
            f"--key {file}: {error.strerror}; name the .pub.pem that python -m deploy keys wrote"
        ) from error
