"""Reports of calibrations as text, pages and figures; no estimation is done here."""
