"""Recording of live cells: drivers, detection of stillness, and execution of plans."""
