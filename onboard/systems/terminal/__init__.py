"""The container terminal: lanes, crossings, areas and stations (Le Page and Barras, MARTHA)."""
