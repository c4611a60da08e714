"""A site file as tables that are written one behind the other."""

#: Tables of a site file by their header; several of one header are a list.
Tables = list[tuple[str, dict[str, object]]]


def site_text(tables: Tables) -> str:
    """TOML of the tables, in their order; values are text, whole numbers, truth values, and lists of these."""
    lines = [
        line
        for header, keys in tables
        for line in (header, *(f"{key} = {_written(value)}" for key, value in keys.items()), "")
    ]
    return "\n".join(lines)


def _written(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(_written(one) for one in value) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)
