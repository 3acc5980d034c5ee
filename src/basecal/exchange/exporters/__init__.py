"""Exporters to files of other programs; each module defines an `EXPORTER`, which `registry` lists by name."""
