"""Where robots shall go, as their own programs say it."""
