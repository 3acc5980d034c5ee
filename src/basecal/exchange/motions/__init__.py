"""Where robots shall go, as their own programs say it: a file and a line for each kind."""
