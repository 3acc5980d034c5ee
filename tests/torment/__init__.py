"""Input and faults that nothing may fall over; `make torment` runs it for longer than the tests do."""
