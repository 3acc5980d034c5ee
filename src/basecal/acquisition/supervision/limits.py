"""Times within which processes of a capture answer one another, in seconds."""

TICK_S = 0.01
"""How often each process looks at all others."""

HEARTBEAT_S = 0.05
"""How often each process says that it runs."""

SILENT_S = 0.4
"""Without a heartbeat for so long, a process of an arm, or the supervisor, counts as hung."""

PARENT_SILENT_S = 1.0
"""The same of the capture itself while an arm moves; it computes, and its heartbeat may be late."""

STALE_S = 0.45
"""Without a new state for so long while its arm moves, a link counts as lost."""

STOP_S = 0.3
"""How long an arm has to confirm a stop; then its process is killed, and its watchdog stops it."""

CLOSE_S = 0.9
"""How long an arm's driver has to close."""

FORCED_END_S = 1.2
"""How long the capture may go on after a second Ctrl-C; then it is killed."""
