"""Files for other programs, a module each with a function `exported`; a new one also is a line in the registry."""
