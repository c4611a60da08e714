"""Ed25519 signatures (RFC 8032) by the command ``openssl``: no cipher of our own, and no library on the boards."""

import re
import subprocess
import tempfile
from pathlib import Path

from deploy.update.manifest import UpdateError

SIGNATURE_BYTES = 64
#: What tells a checkout's topmost folder.
_MARKS = (".git", ".hg", ".svn", ".jj")
_LIMIT_S = 60
_PUBLIC = re.compile(rb"-----BEGIN PUBLIC KEY-----\n.*?-----END PUBLIC KEY-----\n", re.DOTALL)


def make_keys(secret: Path, public: Path) -> None:
    """Write a pair of keys as PEM files.

    Raises ``UpdateError``, also where a secret key is there already, or would lie in a checkout: whoever adds all
    files there hands it to everybody, and boards take what it signs.
    """
    checkout = next((one for one in secret.resolve().parents if any((one / mark).exists() for mark in _MARKS)), None)
    if checkout is not None:
        raise UpdateError(f"{secret}: is inside the checkout {checkout}; name a place outside with --out")
    if secret.exists():
        raise UpdateError(f"{secret}: is there already, and boards may know its public key; name another with --out")
    _openssl("genpkey", "-algorithm", "ed25519", "-out", str(secret))
    secret.chmod(0o600)
    public.write_bytes(public_key(secret))


def public_key(secret: Path) -> bytes:
    """The public key of a secret one, as PEM. Raises ``UpdateError``."""
    return _openssl("pkey", "-in", str(secret), "-pubout").encode()


def public_keys(text: bytes) -> list[bytes]:
    """The public keys in a PEM text, each by itself."""
    return _PUBLIC.findall(text)


def sign(said: bytes, secret: Path) -> bytes:
    """The signature of some bytes. Raises ``UpdateError``."""
    with tempfile.TemporaryDirectory() as folder:
        file, signature = Path(folder, "said"), Path(folder, "signature")
        file.write_bytes(said)
        _openssl("pkeyutl", "-sign", "-inkey", str(secret), "-rawin", "-in", str(file), "-out", str(signature))
        return signature.read_bytes()


def is_signed(said: bytes, signature: bytes, public: Path) -> bool:
    """Whether the owner of one of the keys in ``public``, one PEM after another, has signed these bytes.

    Raises ``UpdateError`` where there is no openssl.
    """
    with tempfile.TemporaryDirectory() as folder:
        file, sealed, key = Path(folder, "said"), Path(folder, "signature"), Path(folder, "key")
        file.write_bytes(said)
        sealed.write_bytes(signature)
        words = ["-verify", "-pubin", "-inkey", str(key), "-rawin", "-in", str(file), "-sigfile", str(sealed)]
        for one in public_keys(public.read_bytes()):
            key.write_bytes(one)
            if _run("pkeyutl", *words).returncode == 0:
                return True
    return False


def _openssl(*words: str) -> str:
    done = _run(*words)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise UpdateError(f"openssl {words[0]}: {last}")
    return done.stdout


def _run(*words: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(["openssl", *words], capture_output=True, text=True, timeout=_LIMIT_S, check=False)
    except FileNotFoundError:
        raise UpdateError("openssl is not installed") from None
