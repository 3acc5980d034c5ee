"""Points of a static scene that several pictures show: features, matches that a rigid scene can have, and tracks."""
