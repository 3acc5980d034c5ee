"""Numbers of an estimation in words, as several findings use them."""
