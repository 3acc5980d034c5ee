"""The faces (typed capabilities) of an effect, and the views that effects act on."""
