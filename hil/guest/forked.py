"""Programs of this project as processes of their own, each forked from one that has imported them already.

The guest's processor is emulated: a start from nothing takes ten seconds there, of which nine are the same imports.
"""

import os
import select
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hil.guest.libc import setns

Main = Callable[[Sequence[str]], int]


class Forked:
    """One child; called as ``subprocess.Popen`` where it can do the same."""

    def __init__(
        self,
        main: Main,
        words: Sequence[str],
        *,
        namespace: str,
        folder: Path,
        output: str,
        stdin: int | None = None,
    ) -> None:
        """Run ``main(words)`` in this network namespace and folder, with both outputs in one file of the folder.

        ``stdin`` is a descriptor; without it the input is that of this process.
        """
        self._status: int | None = None
        sys.stdout.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _live(main, words, namespace, folder / output, stdin)

    def poll(self) -> int | None:
        """The exit status, negative for a signal, or None while it runs."""
        if self._status is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self._status = os.waitstatus_to_exitcode(status)
        return self._status

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end. Raises ``TimeoutError`` after ``timeout`` seconds."""
        if self.poll() is None:
            descriptor = os.pidfd_open(self.pid)
            select.select([descriptor], [], [], timeout)
            os.close(descriptor)
        status = self.poll()
        if status is None:
            raise TimeoutError
        return status

    def terminate(self) -> None:
        """Ask it to end (SIGTERM); harmless where it has ended."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once and without warning (SIGKILL); harmless where it has ended."""
        self._signal(signal.SIGKILL)

    def _signal(self, number: signal.Signals) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)


def _live(main: Main, words: Sequence[str], namespace: str, output: Path, stdin: int | None) -> None:
    """The child's whole life; it never returns."""
    status = 70
    try:
        with Path("/run/netns", namespace).open("rb") as file:
            setns(file.fileno())
        os.chdir(output.parent)
        if stdin is not None:
            os.dup2(stdin, 0)
        with output.open("wb") as out:
            os.dup2(out.fileno(), 1)
            os.dup2(out.fileno(), 2)
        status = main(words)
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException as error:  # noqa: BLE001 - the parent's stack is below: nothing may pass
        print(f"ended by {error!r}", file=sys.stderr)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
