"""The faces of an effect, each a typed capability, and the views that it acts on."""
