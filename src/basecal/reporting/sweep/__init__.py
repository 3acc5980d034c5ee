"""A study of many points as text, as a page and as charts; no estimation is done here."""
