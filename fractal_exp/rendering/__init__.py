"""Any view of a code at any zoom: stills, tiles, sheets, films."""
