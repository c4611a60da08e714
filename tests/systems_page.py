"""``python -m tests.systems_page``: docs/systems.md from docs/systems/*.toml."""

from tests.project.rows import ROOT, page

if __name__ == "__main__":
    (ROOT / "docs" / "systems.md").write_text(page(), encoding="utf-8")
