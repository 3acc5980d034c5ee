"""Periods and timeouts of the processes of a capture, in seconds."""

TICK_S = 0.01
"""Period at which each process checks all others."""

HEARTBEAT_S = 0.05
"""Period of each process's heartbeat."""

HANG_LIMIT_S = 0.4
"""Time without a heartbeat after which an arm's process or the supervisor counts as hung while any arm moves."""

REST_HANG_LIMIT_S = 10.0
"""Time without a heartbeat after which an arm's process counts as hung at rest: connecting may hold Python's lock."""

PARENT_HANG_LIMIT_S = 1.0
"""Time without a heartbeat after which the capture counts as hung while an arm moves: its computations delay it."""

START_S = 10.0
"""Additional time for the supervisor's first heartbeat: starting a process takes long on a busy machine."""

STALE_S = 0.45
"""Time without a new state after which a link counts as lost while any arm moves."""

MOST_CLOCK_DRIFT = 0.01
"""Largest accepted drift of a controller's clock against the clock of this machine [s/s]."""

RECONNECT_S = 10.0
"""Default of a driver's option `reconnect_s`: time for reconnecting a lost link while all arms are at rest."""

REST_STALE_MARGIN_S = 2.0
"""Additional time without a state, after `reconnect_s`, before a link counts as lost at rest."""

HOLD_S = 2.0
"""Time at rest away from the goal after which an arm counts as blocked."""

STOP_S = 0.3
"""Timeout of an arm's confirmation of a stop; then its process is killed if a watchdog stops the arm."""

CLOSE_S = 0.9
"""Timeout for an arm's driver to close."""

FORCED_END_S = 1.2
"""Timeout for the capture to end after a second Ctrl-C; then it is killed."""
