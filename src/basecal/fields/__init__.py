"""Numbers, sigmas, poses and entries as files hold them, and what is wrong with one, in one line."""
