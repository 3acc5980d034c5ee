"""All rules for accepting a wider or an alternative model of the data."""
