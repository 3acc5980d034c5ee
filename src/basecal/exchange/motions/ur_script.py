"""A program of URScript for one arm, that waits at each sample until somebody goes on.

`movej` takes joints [rad], or a pose of the flange, for which the controller finds the joints. In the second case the
tool has to be the flange itself, which `set_tcp` ensures.
"""

from __future__ import annotations

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.motions.way import Motion, Way

_ACCELERATION = 0.5  # [rad/s^2], a third of what the arms begin with


def write_motion(way: Way) -> str:
    """The program.

    Raises:
        InputError: if several robots are sent.
    """
    robot = way.single_robot()
    lines = [f"def basecal_{robot}():", "  set_tcp(p[0, 0, 0, 0, 0, 0])"]
    for place, sample in enumerate(way.samples, start=1):
        joints = sample.robots[robot].joints_rad
        numbers = CONTROLLERS["ur"].to_numbers(way.pose(robot, sample)) if joints is None else joints
        target = f"{'p' if joints is None else ''}[{', '.join(f'{float(number):.6f}' for number in numbers)}]"
        what = f"sample {sample.sample}, {place} of {len(way.samples)}"
        lines += [
            f'  textmsg("basecal: {what}")',
            f"  movej({target}, a={_ACCELERATION:g}, v={way.speed_rad_s:.4g})",
            f"  sleep({way.hold_s:g})",
            f'  popup("{what}: take the image, then continue", title="basecal", blocking=True)',
        ]
    return "\n".join([*lines, "end", f"basecal_{robot}()"]) + "\n"


MOTION = Motion("with --robot: a program of URScript that waits at each sample", write_motion)
