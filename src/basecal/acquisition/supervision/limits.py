"""Times within which processes of a capture answer one another, in seconds."""

TICK_S = 0.01
"""How often each process looks at all others."""

HEARTBEAT_S = 0.05
"""How often each process says that it runs."""

SILENCE_LIMIT_S = 0.4
"""Without a heartbeat for so long while any arm moves, a process of an arm, or the supervisor, counts as hung."""

REST_HANG_LIMIT_S = 10.0
"""The same while all arms stand: a library may hold Python's lock while it connects."""

PARENT_SILENCE_LIMIT_S = 1.0
"""The same of the capture itself while an arm moves; it computes, and its heartbeat may be late."""

START_S = 10.0
"""How much longer the supervisor may be silent at first: a busy machine takes its time to start a process."""

STALE_S = 0.45
"""Without a new state for so long while any arm moves, a link counts as lost."""

RECONNECT_S = 10.0
"""How long a driver may try a lost link again while all arms stand, unless its option `reconnect_s` says otherwise."""

REST_SILENCE_LIMIT_S = 2.0
"""How long a link may be silent beyond that."""

HOLD_S = 2.0
"""An arm that stands still for so long away from its goal is held up by something that nobody reported."""

STOP_S = 0.3
"""How long an arm has to confirm a stop; then its process is killed, and its watchdog stops it."""

CLOSE_S = 0.9
"""How long an arm's driver has to close."""

FORCED_END_S = 1.2
"""How long the capture may go on after a second Ctrl-C; then it is killed."""
