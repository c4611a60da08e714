"""``pytest deploy``: what takes minutes and root, and is not part of ``make test``."""

from pathlib import Path

import pytest

from deploy.image.root import Root, build_root


@pytest.fixture(scope="session")
def root(tmp_path_factory: pytest.TempPathFactory) -> Root:
    """The root file system, freshly built."""
    return build_root(Path(tmp_path_factory.mktemp("root")))
