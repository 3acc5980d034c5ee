"""Every rule that decides whether a wider or another model of the data is to be believed."""
