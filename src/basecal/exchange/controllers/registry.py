"""Every controller whose way to write poses is known: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.exchange.controllers import (
    abb,
    denso,
    doosan,
    fanuc,
    franka,
    kuka,
    matrix,
    ros,
    staubli,
    ur,
    xarm,
    yaskawa,
)
from basecal.exchange.controllers.convention import AnyConvention

CONTROLLERS: Mapping[str, AnyConvention] = {
    "ur": ur.CONVENTION,
    "kuka": kuka.CONVENTION,
    "abb": abb.CONVENTION,
    "fanuc": fanuc.CONVENTION,
    "yaskawa": yaskawa.CONVENTION,
    "staubli": staubli.CONVENTION,
    "denso": denso.CONVENTION,
    "franka": franka.CONVENTION,
    "doosan": doosan.CONVENTION,
    "xarm": xarm.CONVENTION,
    "ros": ros.CONVENTION,
    "matrix": matrix.CONVENTION,
}
"""Conventions by the controller's name."""
