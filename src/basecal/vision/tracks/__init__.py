"""Points of a static scene in several images: features, geometrically verified matches, and tracks."""
