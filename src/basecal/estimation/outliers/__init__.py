"""Views and points that do not belong to the rest."""
