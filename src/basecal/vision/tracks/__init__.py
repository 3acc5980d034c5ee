"""Points of a static scene that several images show: features, matches that a rigid scene can have, and tracks."""
