"""``python -m onboard.contract.generate``: writes what ``onboard/contract`` has of ``dbc/*.dbc``."""

import sys
from pathlib import Path

from onboard.contract.generate.model import ContractError
from onboard.contract.generate.modules import contracts, generated

FOLDER = Path(__file__).parents[1]


def main() -> int:
    """Write the files; returns the exit status."""
    try:
        files = generated(contracts())
    except ContractError as error:
        print(error, file=sys.stderr)
        return 2
    for name, text in files.items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
