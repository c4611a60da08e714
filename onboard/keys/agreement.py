"""X25519 (RFC 7748) by the command ``openssl``, and the keys that two nodes have of it: no cipher of our own."""

import subprocess
import tempfile
from hashlib import blake2s
from pathlib import Path

from onboard.seal.keys import KEY_BYTES

_LIMIT_S = 60
#: Bytes before the key in the SubjectPublicKeyInfo of X25519 (RFC 8410).
_PREFIX = bytes.fromhex("302a300506032b656e032100")
_PERSON = b"fleetkey"
_FINGERPRINT_BYTES = 16


class KeysError(Exception):
    """Keys that cannot be made or used; ``str`` is one line: what is wrong, what to do."""


def new_identity() -> bytes:
    """The PEM of a new secret key. Raises ``KeysError``."""
    return _openssl("genpkey", "-algorithm", "X25519")


def public_of(secret: Path) -> bytes:
    """The 32 bytes that others may know of a secret key. Raises ``KeysError``."""
    told = _openssl("pkey", "-in", str(secret), "-pubout", "-outform", "DER")
    if not told.startswith(_PREFIX) or len(told) != len(_PREFIX) + KEY_BYTES:
        raise KeysError(f"{secret}: is no X25519 key; move the file away and make another")
    return told[len(_PREFIX) :]


def fingerprint(public: bytes) -> str:
    """What a person compares: 128 bits in groups of four digits."""
    digits = blake2s(public, digest_size=_FINGERPRINT_BYTES, person=_PERSON).hexdigest()
    return " ".join(digits[at : at + 4] for at in range(0, len(digits), 4))


def pair_key(secret: Path, own: tuple[int, bytes], other: tuple[int, bytes], site: str) -> bytes:
    """The key of two nodes, the same from either's secret; both as node-ID and public key. Raises ``KeysError``."""
    with tempfile.TemporaryDirectory() as folder:
        peer = Path(folder, "peer")
        peer.write_bytes(_PREFIX + other[1])
        words = ("-derive", "-inkey", str(secret), "-peerkey", str(peer), "-peerform", "DER")
        shared = _openssl("pkeyutl", *words)
    ends = b"".join(bytes([node]) + public for node, public in sorted((own, other)))
    return blake2s(site.encode() + b"\0" + ends, key=shared, digest_size=KEY_BYTES, person=_PERSON).digest()


def _openssl(*words: str) -> bytes:
    try:
        done = subprocess.run(["openssl", *words], capture_output=True, timeout=_LIMIT_S, check=False)
    except FileNotFoundError:
        raise KeysError("openssl is not installed; apt install openssl") from None
    if done.returncode:
        last = (done.stderr.decode(errors="replace").strip().splitlines() or ["it said nothing"])[-1]
        raise KeysError(f"openssl {words[0]}: {last}")
    return done.stdout
